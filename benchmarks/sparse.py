"""Time the sparse U-Net in units of one plain sparse convolution, and compare with the marks.

    python benchmarks/sparse.py [--data FOLDER] [--sequence 00] [--scan 5] [--rounds 7]

FOLDER is a SemanticKITTI root (it holds sequences/); without one, the sweep is of a made-up street.
"""

import argparse
import resource
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings, UNetSettings
from most.sparse import KernelMap, Sites, SparseTensor, sparse_conv

VOXEL, LOWER, SHAPE = (0.075, 0.075, 0.2), (-54.0, -54.0, -4.0), (1440, 1440, 32)  # m, m, voxels
IN_CHANNELS = 16
UNITS = 10  # in a turn
MARKS = {"2-wide": (55, 50), "3-wide": (90, 80)}  # units: forward, forward + backward


class PlainConv(torch.autograd.Function):
    """The unit: gather, multiply, index_add, offset by offset, forwards and backwards."""

    @staticmethod
    def forward(ctx, features: Tensor, taps: Tensor, pairs: list[tuple[Tensor, Tensor]]) -> Tensor:
        """Add each offset's products to the rows they belong to."""
        ctx.save_for_backward(features, taps)
        ctx.pairs = pairs
        out = features.new_zeros(len(features), taps.shape[2])
        for tap, (inputs, outputs) in zip(taps, pairs, strict=True):
            out.index_add_(0, outputs, features.index_select(0, inputs) @ tap)
        return out

    @staticmethod
    def backward(ctx, gradient: Tensor) -> tuple[Tensor, Tensor, None]:
        """Go the same pairs the other way."""
        features, taps = ctx.saved_tensors
        by_features, by_taps = torch.zeros_like(features), torch.zeros_like(taps)
        for tap, by_tap, (inputs, outputs) in zip(taps, by_taps, ctx.pairs, strict=True):
            gathered = gradient.index_select(0, outputs)
            torch.mm(features.index_select(0, inputs).t(), gathered, out=by_tap)
            by_features.index_add_(0, inputs, gathered @ tap.t())
        return by_features, by_taps, None


def real_sweep(root: Path, sequence: str, scan: int) -> Tensor:
    file = root / "sequences" / sequence / "velodyne" / f"{scan:06d}.bin"
    return torch.from_numpy(np.fromfile(file, np.float32).reshape(-1, 4)[:, :3])


def made_up_sweep() -> Tensor:
    """64 beams over a flat road between two rows of houses, with boxes for cars."""
    random = torch.Generator().manual_seed(0)
    turn = torch.arange(1900) * (2 * torch.pi / 1900)
    tilt = torch.deg2rad(torch.linspace(-24.8, 2.0, 64))
    ray = torch.stack(
        [turn.cos()[:, None] * tilt.cos(), turn.sin()[:, None] * tilt.cos(), tilt.sin().expand(1900, -1)], -1
    )
    ray = ray.flatten(0, 1)
    distance = torch.where(ray[:, 2] < 0, -1.8 / ray[:, 2].clamp(max=-1e-6), 80.0)
    centres = torch.rand(90, 2, generator=random) * 90 - 45
    low = torch.cat([centres - 1.2, torch.full((90, 1), -1.8)], 1)
    houses = torch.tensor([[-60.0, 12.0, -1.8, 60.0, 14.0, 6.0], [-60.0, -17.0, -1.8, 60.0, -15.0, 6.0]])
    for box in torch.cat([torch.cat([low, low + torch.tensor([2.4, 2.4, 1.6])], 1), houses]):
        sides = torch.stack([box[:3] / (ray + 1e-9), box[3:] / (ray + 1e-9)])
        near, far = sides.amin(0).amax(1), sides.amax(0).amin(1)
        distance = torch.where((near < far) & (near > 1), torch.minimum(distance, near), distance)
    points = ray * (distance + 0.02 * torch.randn(len(ray), generator=random))[:, None]
    return points[distance < 75]


def occupied(points: Tensor) -> Tensor:
    cells = ((points - torch.tensor(LOWER)) / torch.tensor(VOXEL)).floor().long()
    cells = cells[((cells >= 0) & (cells < torch.tensor(SHAPE))).all(1)].unique(dim=0)
    return torch.cat([torch.zeros(len(cells), 1, dtype=torch.long), cells], 1)


def plain_pairs(kernel_map: KernelMap, rows: int) -> list[tuple[Tensor, Tensor]]:
    inputs, outputs = ([r.long() for r in rows] for rows in (kernel_map.input_rows, kernel_map.output_rows))
    inputs[kernel_map.centre] = outputs[kernel_map.centre] = torch.arange(rows)
    return list(zip(inputs, outputs, strict=True))


def unit(coordinates: Tensor) -> tuple[Callable[[], None], Callable[[], None]]:
    """One 32 -> 32, 3 x 1 x 3 submanifold convolution over all voxels; its map is built beforehand."""
    kernel_map = Sites(coordinates, SHAPE, 1).submanifold((3, 1, 3))
    pairs = plain_pairs(kernel_map, len(coordinates))
    features, gradient = torch.randn(2, len(coordinates), 32)
    features.requires_grad_()
    weight = torch.randn(32, 3, 1, 3, 32) * 0.1
    taps = weight.flatten(1, 3).permute(1, 2, 0).contiguous().requires_grad_()
    with torch.no_grad():
        torch.testing.assert_close(
            PlainConv.apply(features, taps, pairs), sparse_conv(features, weight, kernel_map), rtol=1e-3, atol=1e-3
        )
    return (
        without_gradients(lambda: PlainConv.apply(features, taps, pairs)),
        lambda: PlainConv.apply(features, taps, pairs).backward(gradient),
    )


def repeated(function: Callable[[], None]) -> Callable[[], None]:
    """Short as it is, the unit would slip through between what else the machine does; ten in a row do not."""

    def run() -> None:
        for _ in range(UNITS):
            function()

    return run


def without_gradients(function: Callable[[], object]) -> Callable[[], None]:
    def run() -> None:
        with torch.no_grad():
            function()

    return run


class NoBev(nn.Module):
    """In place of the BEV branch, which is dense and measured by itself."""

    def forward(self, x: SparseTensor) -> tuple[SparseTensor, Tensor]:
        """Pass the voxels on."""
        return x, x.features


def network(settings: UNetSettings, coordinates: Tensor, bev: bool) -> tuple[Callable[[], None], Callable[[], None]]:
    """A backbone from fresh coordinates, so that building all of its kernel maps is part of what is timed."""
    model = settings.build(IN_CHANNELS, SHAPE)
    if not bev:
        model.bev = NoBev()
    features = torch.randn(len(coordinates), IN_CHANNELS)

    def forward() -> Tensor:
        out = model(SparseTensor(features, Sites(coordinates, SHAPE, 1)))
        return out.voxels.square().mean() + (out.bev.square().mean() if bev else 0)

    return without_gradients(forward), lambda: forward().backward()


def medians(functions: dict[str, Callable[[], None]], rounds: int) -> dict[str, float]:
    """Seconds of each; the functions take turns, so that whatever else the machine does falls on all of them."""
    for function in functions.values():
        function()
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(rounds):
        for name, function in functions.items():
            start = time.perf_counter()
            function()
            seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--sequence", default="00")
    parser.add_argument("--scan", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    torch.manual_seed(0)
    points = real_sweep(options.data, options.sequence, options.scan) if options.data else made_up_sweep()
    coordinates = occupied(points)
    print(
        f"{len(points)} points, {len(coordinates)} voxels, {torch.get_num_threads()} threads, torch {torch.__version__}"
    )

    cases = {
        "sparse U-Net, 2-wide": network(UNetSettings(down_kernel=2), coordinates, bev=False),
        "sparse U-Net, 3-wide": network(UNetSettings(down_kernel=3), coordinates, bev=False),
        "asymmetric_unet_small": network(AsymmetricUNetSmallSettings(), coordinates, bev=True),
        "asymmetric_unet": network(AsymmetricUNetSettings(), coordinates, bev=True),
        "residual_unet": network(ResidualUNetSettings(), coordinates, bev=True),
    }
    plain = unit(coordinates)
    ratios = []
    for way in (0, 1):
        seconds = medians(
            {"unit": repeated(plain[way])} | {name: both[way] for name, both in cases.items()}, options.rounds
        )
        seconds["unit"] /= UNITS
        ratios.append({name: value / seconds["unit"] for name, value in seconds.items()})
        print(f"unit, {('forward', 'forward + backward')[way]}: {1000 * seconds['unit']:.1f} ms")
    print(f"\n{'units':<26}{'forward':>9}{'mark':>6}{'fwd + bwd':>11}{'mark':>6}")
    for name in cases:
        marks = MARKS.get(name.rpartition(", ")[2], ("", ""))
        print(f"{name:<26}{ratios[0][name]:>9.1f}{marks[0]:>6}{ratios[1][name]:>11.1f}{marks[1]:>6}")
    print(f"\npeak memory of the process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GB")


if __name__ == "__main__":
    main()

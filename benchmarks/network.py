"""Time the whole stage-1 network by part, for 1 and 11 sweeps, and measure a training step's peak memory.

    python benchmarks/network.py [--data FOLDER] [--sequence 00] [--scan 9] [--rounds 5] [--backbone asymmetric_unet]

FOLDER is a SemanticKITTI root; without one the sweeps are simulated. A sequence shorter than 11 sweeps is filled up
with copies of its first sweep, moved back step by step, so that the window is as large as a full one.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import torch

from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings
from most.datasets.dataset import WindowDataset
from most.datasets.instances import InstanceTables
from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI
from most.encoder import PointEncoder
from most.heads import CentreHead, SemanticHead
from most.inference import Inference, Predictor
from most.membership import Nearest
from most.modal.extent import TrackMax
from most.network import Network
from most.sparse import Sites, SparseTensor
from most.stages.detection import DetectionStage, DetectionTraining
from most.structures import Sample
from most.voxels import Grid, voxelise

BACKBONES = {
    "asymmetric_unet": AsymmetricUNetSettings,
    "asymmetric_unet_small": AsymmetricUNetSmallSettings,
    "residual_unet": ResidualUNetSettings,
}
WINDOW = 11  # sweeps, the paper's
MEMORY_MARKS = {1: 3.0, WINDOW: 6.0}  # GB


def window(root: Path, sequence: str, scan: int, sweeps: int, folder: Path) -> Sample:
    """The sample of a scan with as many sweeps as asked for."""
    reader = SemanticKITTI(root)
    tables = InstanceTables(reader, TrackMax(), folder)
    sample = WindowDataset(reader, [Frame(sequence, scan)], sweeps - 1, instances=tables)[0]
    missing = sweeps - len(sample.points[:, 4].unique())
    oldest = sample.points[sample.points[:, 4] == sample.points[:, 4].min()] if sweeps > 1 else sample.points[:0]
    step = oldest.new_tensor([-0.8, 0.0, 0.0, 0.0, -0.1])
    filled = [oldest + step * (number + 1) for number in range(missing)]
    sample.points = torch.cat([sample.points, *filled])
    return sample


def stage_of(backbone: str, reader: SemanticKITTI) -> DetectionStage:
    """The reference network around a backbone."""
    grid, taxonomy = Grid(), reader.taxonomy
    encoder = PointEncoder().build(grid)
    trunk = BACKBONES[backbone]().build(encoder.voxel_channels, grid.shape)
    semantic = SemanticHead().build(19, trunk.voxel_channels, encoder.point_channels, trunk.bev_channels)
    network = Network(grid, encoder, trunk, CentreHead().build(trunk.bev_channels, 8), semantic)
    predictor = Predictor(network, taxonomy.things, taxonomy.stuff[0], Nearest(), Inference())
    return DetectionStage(predictor, taxonomy, torch.ones(20, dtype=torch.long), DetectionTraining(), {}, steps=1)


def clocked(times: dict[str, list[float]], name: str, task: Callable) -> object:
    """Run a task and note how long it took."""
    start = time.perf_counter()
    result = task()
    times.setdefault(name, []).append(time.perf_counter() - start)
    return result


def parts(stage: DetectionStage, sample: Sample, times: dict[str, list[float]]) -> None:
    """Time one forward pass part by part, without gradients."""
    network = stage.network
    with torch.no_grad():
        voxels = clocked(times, "voxelise", lambda: voxelise([sample], network.grid))
        points = sample.points[voxels.inputs]
        points_, voxels_ = clocked(times, "point MLP", lambda: network.encoder(points, voxels))
        sites = Sites(voxels.coordinates, voxels.shape, 1)
        features = clocked(times, "backbone", lambda: network.backbone(SparseTensor(voxels_, sites)))
        clocked(times, "detection head", lambda: network.centre_head(features.bev))
        cells = network.voxel_cells(voxels)
        heads = (features.voxels, points_, features.bev, voxels.point_voxel, cells[voxels.point_voxel])
        clocked(times, "semantic head", lambda: network.semantic_head(*heads))
    output = clocked(times, "forward", lambda: network([sample]))
    losses = clocked(times, "targets, losses", lambda: torch.stack(list(stage.losses([sample], output).values())).sum())
    clocked(times, "backward", losses.backward)
    with torch.no_grad():
        clocked(times, "predict", lambda: stage.predictor([sample]))


def memory(arguments: argparse.Namespace, sweeps: int) -> float:
    """Peak resident memory (GB) of a process of its own that takes two training steps."""
    command = [sys.executable, __file__, "--step", str(sweeps), "--sequence", arguments.sequence]
    command += ["--scan", str(arguments.scan), "--backbone", arguments.backbone, "--data", str(arguments.data)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def peak_memory() -> float:
    """Peak resident memory of this process, GB; getrusage would count that of the process which started it."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(status["VmHWM"].split()[0]) / 1e6


def step(stage: DetectionStage, sample: Sample) -> None:
    """One training step with the paper's optimiser."""
    optimizer = torch.optim.Adam(stage.network.parameters(), lr=1e-3)
    torch.stack(list(stage.losses([sample], stage.network([sample])).values())).sum().backward()
    optimizer.step()


def simulated(folder: Path) -> Path:
    """A simulated sequence of eleven sweeps, where no real one is given."""
    from most.simulation import SimulationSettings, simulate

    simulate(SimulationSettings(sequences=["00"], scans=WINDOW), folder)
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--sequence", default="00")
    parser.add_argument("--scan", type=int, default=9)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--backbone", choices=BACKBONES, default="asymmetric_unet")
    parser.add_argument("--step", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        arguments.data = arguments.data or simulated(Path(folder) / "streets")
        place = (arguments.data, arguments.sequence, arguments.scan)
        if arguments.step:
            sample = window(*place, arguments.step, Path(folder))
            stage = stage_of(arguments.backbone, SemanticKITTI(arguments.data))
            step(stage, sample)
            step(stage, sample)
            print(peak_memory())
            return
        for sweeps in (1, WINDOW):
            report(arguments, sweeps, window(*place, sweeps, Path(folder)))


def report(arguments: argparse.Namespace, sweeps: int, sample: Sample) -> None:
    """Print shares of the forward pass, and memory against its mark."""
    stage, times = stage_of(arguments.backbone, SemanticKITTI(arguments.data)), {}
    for _ in range(arguments.rounds + 1):
        parts(stage, sample, times)
    middle = {name: statistics.median(values[1:]) for name, values in times.items()}
    print(
        f"\n{arguments.backbone}, {sweeps} sweep(s), {len(sample.points)} points, {torch.get_num_threads()} thread(s)"
    )
    for name, seconds in middle.items():
        print(f"  {name:16s} {seconds:7.3f} s   {seconds / middle['forward']:6.2f} of a forward pass")
    used, mark = memory(arguments, sweeps), MEMORY_MARKS[sweeps]
    print(
        f"  peak memory of a training step: {used:.2f} GB (mark {mark:.0f} GB: {'met' if used <= mark else 'MISSED'})"
    )


if __name__ == "__main__":
    main()

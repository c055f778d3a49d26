"""Time a stream scan by scan, from the file to the tracks, and measure its memory.

    python benchmarks/stream.py --checkpoint FILE --data FOLDER [--sequence 09] [--scans 1000] [--sweeps 0 10]

FILE is a model that most.train wrote, FOLDER the root of a SemanticKITTI tree, simulated or real. The sequence's scans
are played forwards, backwards, forwards and so on, a tenth of a second apart: the way of the sensor has no jump. Each
number of previous sweeps is measured in a process of its own.
"""

import argparse
import json
import subprocess
import sys
import time
from itertools import chain, cycle, islice

import numpy as np
import torch
from network import peak_memory

import most.network
from most.datasets.semantickitti import SemanticKITTI
from most.streaming import PanopticTracker
from most.structures import Sample, Voxels
from most.voxels import Grid

WARM_UP = 12  # scans that are not counted: the window fills, memory is taken
PAPER = 169.9  # ms a scan, on a GPU, as the paper says


def stream(arguments: argparse.Namespace, previous: int) -> dict[str, list[float]]:
    """Label scans; return the milliseconds that each stage of each scan took."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    model = PanopticTracker.from_checkpoint(arguments.checkpoint, device=device)
    model.previous = previous
    model.begin()
    reader = SemanticKITTI(arguments.data)
    frames = reader.frames_of(arguments.sequence)
    times: dict[str, list[float]] = {}
    voxelising = watch_voxelising()
    for number, frame in enumerate(islice(cycle(chain(frames, frames[-2:0:-1])), WARM_UP + arguments.scans)):
        begin = time.perf_counter()
        sweep = reader.sweep(frame)
        seconds = {"load": time.perf_counter() - begin}
        seconds |= model.step(sweep.points, sweep.pose, 0.1 * number).seconds | {"of it, voxelise": voxelising.pop()}
        for name, value in seconds.items() if number >= WARM_UP else ():
            times.setdefault(name, []).append(1000 * value)
    return times


def watch_voxelising() -> list[float]:
    """Return a list to which every voxelisation from here on adds how long it took."""
    plain, seconds = most.network.voxelise, []

    def timed(samples: list[Sample], grid: Grid) -> Voxels:
        begin = time.perf_counter()
        voxels = plain(samples, grid)
        seconds.append(time.perf_counter() - begin)
        return voxels

    most.network.voxelise = timed
    return seconds


def measured(arguments: argparse.Namespace, previous: int) -> dict:
    """What a process of its own measures."""
    command = [sys.executable, __file__, "--checkpoint", arguments.checkpoint, "--data", arguments.data, "--sequence",
               arguments.sequence, "--scans", str(arguments.scans), "--one", str(previous)]  # fmt: skip
    return json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)


def main() -> None:
    """Measure, and print a table of medians, shares and extremes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--data", required=True)
    parser.add_argument("--sequence", default="09")
    parser.add_argument("--scans", type=int, default=1000)
    parser.add_argument("--sweeps", type=int, nargs="+", default=[0, 10], help="previous ones in a window")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one is not None:
        print(json.dumps({"times": stream(arguments, arguments.one), "memory": peak_memory()}))
        return
    for previous in arguments.sweeps:
        report(previous, **measured(arguments, previous))


def report(previous: int, times: dict[str, list[float]], memory: float) -> None:
    """Print what one window's length takes."""
    whole = np.sum([values for name, values in times.items() if not name.startswith("of it")], 0)
    where = torch.cuda.get_device_name() if torch.cuda.is_available() else f"CPU, {torch.get_num_threads()} threads"
    print(f"\n{1 + previous} sweep(s), {len(whole)} scans, {where}, peak memory {memory:.2f} GB")
    print(f"{'stage':<16}{'share':>8}{'median ms':>12}{'p99 ms':>10}")
    for name in ("load", "accumulate", "network", "of it, voxelise", "fusion", "tracking"):
        values = np.array(times[name])
        share = np.median(values) / np.median(whole)
        print(f"{name:<16}{share:>8.2f}{np.median(values):>12.1f}{np.quantile(values, 0.99):>10.1f}")
    print(f"{'all':<16}{1:>8.2f}{np.median(whole):>12.1f}{np.quantile(whole, 0.99):>10.1f}   (the paper: {PAPER} ms)")


if __name__ == "__main__":
    main()

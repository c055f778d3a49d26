"""Random scenes score as the official nuScenes evaluators score them, run in their own environment."""

import json
import math

import numpy as np
import pytest
import torch

from most.datasets.taxonomy import Taxonomy
from most.metrics.running import PanopticQuality
from most.metrics.running_tracking import NuScenesLSTQ, PanopticTracking
from oracles.devkit import devkit, needs_devkit
from random_scenes import RandomScenes, random_scenes

CASES, MIN_POINTS = 60, 5
TAXONOMY = Taxonomy.load("nuscenes")
SEGMENTATION = {"pq": "pq", "sq": "sq", "rq": "rq", "miou": "miou"}
TRACKING = {name: name for name in ("pat", "tq", "ptq", "sptq", "motsa", "smotsa", "motsp")} | {"pq": "track_pq"}
LSTQ = {"lstq": "lstq", "s_assoc": "s_assoc", "s_cls": "miou"}


def classes_of(scenes: RandomScenes) -> np.ndarray:
    return TAXONOMY.to_training(torch.from_numpy(scenes.truth.astype(np.int64))).numpy()


@pytest.fixture(scope="module")
def official(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, float]]:
    """The devkit's figures of all cases, from one run."""
    folder, arrays = tmp_path_factory.mktemp("devkit"), {}
    for case in range(CASES):
        scenes = random_scenes(case)
        arrays |= {f"{name}_{case}": values for name, values in vars(scenes).items()}
        arrays[f"classes_{case}"] = classes_of(scenes)
    np.savez(folder / "cases.npz", cases=CASES, min_points=MIN_POINTS, **arrays)
    done = devkit("devkit_figures.py", folder / "cases.npz", folder / "figures.json")
    assert done.returncode == 0, done.stderr
    figures: list[dict[str, float]] = json.loads((folder / "figures.json").read_text())
    return figures


def ours(scenes: RandomScenes) -> list[dict[str, float]]:
    """Figures of segmentation, tracking and LSTQ."""
    told = (TAXONOMY.class_names, TAXONOMY.things, MIN_POINTS)
    quality, tracking, lstq = PanopticQuality(*told), PanopticTracking(*told), NuScenesLSTQ(*told)
    pred, truth = (torch.from_numpy(labels.astype(np.int64)) for labels in (scenes.pred, scenes.truth))
    known, scan = TAXONOMY.to_training(truth), torch.from_numpy(scenes.scan)
    for number, sequence in enumerate(scenes.scene.tolist()):
        points = scan == number
        arrays = TAXONOMY.decode(pred[points]), pred[points], known[points], truth[points]
        quality.update(*arrays)
        tracking.update(sequence, *arrays)
        lstq.update(sequence, *arrays)
    return [metric.compute() for metric in (quality, tracking, lstq)]


@needs_devkit
@pytest.mark.parametrize("case", range(CASES))
def test_figures_are_the_devkits(official: list[dict[str, float]], case: int) -> None:
    figures = ours(random_scenes(case))
    for found, names, tolerance in zip(figures, (SEGMENTATION, TRACKING, LSTQ), (1e-9, 1e-6, 1e-9), strict=True):
        for name, theirs in names.items():
            expected = pytest.approx(official[case][theirs], abs=tolerance, rel=0, nan_ok=True)
            assert found[name] == expected, name


@needs_devkit
def test_the_scenes_hold_what_may_differ(official: list[dict[str, float]]) -> None:
    """Switches of which some are soft, qualities above 0, cases without a track, negative PTQ or MOTSA."""
    assert sum(case["ptq"] < case["sptq"] for case in official) > CASES / 8
    assert sum(case["tq"] > 0.1 for case in official) > CASES / 4
    assert any(math.isnan(case["tq"]) for case in official)
    assert any(case["motsa"] < 0 for case in official)
    assert len({round(case["s_assoc"], 6) for case in official}) > CASES / 2


def test_random_scenes_are_the_same_every_time() -> None:
    one, other = random_scenes(3), random_scenes(3)
    assert all(np.array_equal(values, getattr(other, name)) for name, values in vars(one).items())
    assert one.scan.max() + 1 == len(one.scene)

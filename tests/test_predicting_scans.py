"""Scans of any sensor get labels over time, and a run that was interrupted goes on."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from most.assembly import Trained
from most.datasets.labels import read_labels
from most.datasets.scan_folder import ScanFolder, ScanFolderSettings
from most.datasets.taxonomy import LabelCode
from most.errors import DataError
from most.metrics.assignments import assignments_path, read_assignments
from most.predicting_scans import describe_scans, label_scans
from most.streaming import PanopticTracker
from semantickitti_tree import lidar_pose
from tiny import TAXONOMY, cloud, tiny_predictor


@pytest.fixture
def model():
    return PanopticTracker(Trained(tiny_predictor(9), TAXONOMY, 2))


@pytest.fixture
def folder(tmp_path):
    """Twelve scans of 300 points, in the order of their numbers: scan 10 after scan 9."""
    (made := tmp_path / "scans").mkdir()
    for index in range(12):
        np.save(made / f"scan_{index}.npy", cloud(300, seed=index).numpy())
    np.savetxt(tmp_path / "poses.txt", [lidar_pose(index)[:3].ravel() for index in range(12)])
    return made


def labels(out):
    return {path.name: path.read_bytes() for path in (out / "predictions").iterdir()}


@pytest.mark.parametrize("posed", [True, False])
@pytest.mark.filterwarnings("ignore:.*no pose")
def test_labels_are_those_of_the_stream(model, folder, tmp_path, posed):
    poses = tmp_path / "poses.txt"
    scans, out = ScanFolder(folder, ScanFolderSettings(poses=str(poses) if posed else None)), tmp_path / "out"
    label_scans(model, scans, out)
    model.begin()
    for index in range(12):
        points = np.load(folder / f"scan_{index}.npy")
        step = model.step(points, scans.poses[index] if posed else None, 0.1 * index)
        path = out / f"predictions/scan_{index}.label"
        assert torch.equal(read_labels(path), TAXONOMY.encode(step.semantics, step.ids))
        assert torch.equal(read_assignments(assignments_path(path)).assigned, step.prediction.claimed)
        assert step.ids.any()


FEW_NUMBERS = replace(TAXONOMY, label=LabelCode("class", step=3, unique_in="class"))  # 1, and 2 for all others


@pytest.mark.parametrize("taxonomy", [TAXONOMY, FEW_NUMBERS])
@pytest.mark.filterwarnings("ignore:.*no pose")
def test_a_run_that_goes_on_writes_what_it_would_have_written(taxonomy, folder, tmp_path):
    model = PanopticTracker(Trained(tiny_predictor(9), taxonomy, 2))
    scans, out = ScanFolder(folder), tmp_path / "out"
    label_scans(model, scans, out)
    whole = labels(out)
    assert len(model.tracker.tracks().ids.unique()) > 1
    for index in (4, 10, 11):
        (out / f"predictions/scan_{index}.label").unlink()
    label_scans(model, scans, out)
    assert labels(out) == whole


@pytest.mark.filterwarnings("ignore:.*no pose")
def test_labels_that_do_not_fit_the_scan_are_refused_by_name(model, folder, tmp_path):
    scans, out = ScanFolder(folder), tmp_path / "out"
    label_scans(model, scans, out)
    np.save(folder / "scan_3.npy", cloud(299).numpy())
    with pytest.raises(
        DataError, match=r"scan_3\.label: labels: expected a label for each of the scan's 299 points, found 300"
    ):
        label_scans(model, scans, out)


def test_what_was_labelled_is_told_from_other_scans(folder):
    with pytest.warns(UserWarning, match="no poses"):
        plain, scaled = ScanFolder(folder), ScanFolder(folder, ScanFolderSettings(intensity_scale=255.0))
    assert describe_scans(plain) != describe_scans(scaled)
    (folder / "scan_11.npy").unlink()
    with pytest.warns(UserWarning, match="no poses"):
        assert describe_scans(plain) != describe_scans(ScanFolder(folder))

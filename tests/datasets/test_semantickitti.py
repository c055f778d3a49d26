from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from most.datasets.reader import Frame
from most.datasets.semantickitti import SemanticKITTI, SemanticKITTISettings, Splits
from most.errors import ConfigError, DataError
from semantickitti_tree import CAR, lidar_pose


def test_official_splits() -> None:
    splits = Splits()
    assert splits.train == ["00", "01", "02", "03", "04", "05", "06", "07", "09", "10"]
    assert splits.val == ["08"]
    assert splits.test == ["11", "12", "13", "14", "15", "16", "17", "18", "19", "20", "21"]


def test_command_line_names_sequences_without_quotes() -> None:
    override = OverridesParser.create().parse_override("dataset.splits.val=[07,10]")
    merged = OmegaConf.merge(OmegaConf.structured(Splits), {"val": override.value()})
    assert OmegaConf.to_object(merged).val == ["07", "10"]  # type: ignore[union-attr]


def test_a_sequence_named_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"dataset\.splits\.val: expected each sequence once, found 07, 08 twice"):
        Splits(val=["08", "07", "08", "07", "06"])


def test_unquoted_numbers_of_a_yaml_file_are_refused_with_the_quoted_form() -> None:
    merged = OmegaConf.merge(OmegaConf.structured(Splits), OmegaConf.create("val: [00, 07, 08]"))
    with pytest.raises(ConfigError, match=r"dataset\.splits\.val: .*found \[0, 7, 08\].*write \['00', '07', '08'\]"):
        OmegaConf.to_object(merged)


def test_pose_is_the_lidars(tree: Path) -> None:
    poses = SemanticKITTI(tree).poses("00")
    assert len(poses) == 7  # more rows than the 4 scans
    for index, pose in enumerate(poses):
        np.testing.assert_allclose(pose, lidar_pose(index), atol=1e-12)


def test_scans_may_start_at_any_number(tree: Path, add_sequence: Callable[..., Path]) -> None:
    add_sequence("05", range(7, 9))
    reader = SemanticKITTI(tree)
    frames = reader.frames_of("05")
    assert frames == [Frame("05", 7), Frame("05", 8)]
    sweep = reader.sweep(frames[0])
    assert sweep.index == 7
    assert sweep.time == pytest.approx(0.7)
    np.testing.assert_allclose(sweep.pose, lidar_pose(7), atol=1e-12)


def test_every_third_scan_can_be_a_key_frame(tree: Path, add_sequence: Callable[..., Path]) -> None:
    add_sequence("05", range(2, 8))
    reader = SemanticKITTI(tree, Splits(val=["05"]), key_every=3)
    assert reader.frames("val") == reader.labelled_frames("val") == [Frame("05", 3), Frame("05", 6)]
    assert len(reader.frames_of("05")) == len(reader.annotated("05")) == 6  # velocities are told by all of them
    with pytest.raises(ConfigError, match=r"dataset\.key_every: expected at least 1, found 0"):
        SemanticKITTISettings(key_every=0)


def test_prediction_path_is_the_official_one(tree: Path) -> None:
    path = SemanticKITTI(tree).prediction_path("out", Frame("08", 12))
    assert path == Path("out/sequences/08/predictions/000012.label")


def test_points_that_are_not_finite_stay(tree: Path) -> None:
    path = tree / "sequences/00/velodyne/000000.bin"
    points = np.fromfile(path, "<f4").reshape(-1, 4)
    points[2, 1] = np.nan
    points.tofile(path)
    sweep = SemanticKITTI(tree).sweep(Frame("00", 0))
    assert sweep.labels is not None
    assert len(sweep.points) == len(sweep.labels) == len(points)
    assert sweep.points[2].isnan().tolist() == [False, True, False, False]


def test_missing_sequences_of_a_split_are_warned_about(tree: Path) -> None:
    with pytest.warns(UserWarning, match="train: sequences 01, 02, .* are not there"):
        assert SemanticKITTI(tree).sequences("train") == ["00"]


def test_missing_split_explains_the_tree_and_how_to_simulate_one(tree: Path) -> None:
    with pytest.raises(DataError) as error:
        SemanticKITTI(tree, Splits(val=["07"])).frames("val")
    for part in (
        str(tree / "sequences"),
        "07",
        "velodyne/NNNNNN.bin",
        "poses.txt",
        "SEMANTICKITTI_ROOT",
        f"python -m most.simulate out={tree}",
    ):
        assert part in str(error.value)


def test_labels_suffice_for_scoring(tree: Path) -> None:
    for path in (tree / "sequences/08/velodyne").iterdir():
        path.unlink()
    reader = SemanticKITTI(tree)
    assert reader.labelled_frames("val") == [Frame("08", index) for index in range(3)]
    assert reader.labels(Frame("08", 1))[0] == CAR


def test_training_sequence_without_labels_is_refused(tree: Path) -> None:
    with pytest.raises(DataError, match=r"11/labels: expected the labels .* split val, found no folder"):
        SemanticKITTI(tree, Splits(val=["11"])).frames("val")


def break_file(tree: Path, name: str, content: bytes | None) -> None:
    path = tree / "sequences/00" / name
    path.unlink() if content is None else path.write_bytes(content)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("velodyne/000001.bin", bytes(17), "expected a multiple of 16 bytes .* found 17; .*copy it again"),
        ("velodyne/000001.bin", None, "expected a scan, found no file"),
        ("labels/000001.label", bytes(8), "expected a label for each of the scan's 9 points, found 2; "),
        ("labels/000001.label", bytes(9), "expected a multiple of 4 bytes"),
        ("labels/000001.label", None, "expected a label file, found none"),
        ("poses.txt", b"1 0 0 0 0 1 0 0 0 0 1\n", r"line 1: expected 12 finite number\(s\), found 11"),
        ("poses.txt", b"1 0 0 0 0 1 0 0 0 0 1 nan\n", "line 1: expected 12 finite"),
        ("poses.txt", b"1 0 0 0 0 1 0 0 0 0 1 0\nnot numbers\n", "line 2: .* found 'not numbers'"),
        ("poses.txt", b"\xff\xfe\xfd", "expected text, found bytes"),
        ("poses.txt", b"1 0 0 0 0 1 0 0 0 0 1 0\n", "expected a row for scan 000001, found 1 rows; .*copy"),
        (
            "poses.txt",
            b"1 0 0 0 0 1 0 0 0 0 1 0\n" + b"2 0 0 0 0 1 0 0 0 0 1 0\n" * 2,
            "found none in row 1 and 1 more",
        ),
        ("calib.txt", b"Tr: -1 0 0 0 0 1 0 0 0 0 1 0\n", "Tr: expected rotations .* found none in row 0"),
        ("poses.txt", b"", "expected a row for scan 000001, found 0 rows"),
        ("poses.txt", None, "found no file"),
        ("times.txt", b"0.0\n", "expected a row for scan 000001, found 1 rows"),
        ("times.txt", b"0.0 1.0\n", r"line 1: expected 1 finite number\(s\), found 2"),
        ("times.txt", b"0.0\n0.1\n0.1\n", r", line 3: expected a time after 0\.1 s, found 0\.1 s; a scan is"),
        ("times.txt", None, "found no file"),
        ("calib.txt", b"P0: 1\nP1: 2\n", r"expected a line 'Tr: \.\.\.' .* found P0, P1; "),
        ("calib.txt", b"Tr: 1 2 3\n", "Tr: expected 12 finite"),
        ("calib.txt", None, "expected the sequence's calibration, found no file"),
    ],
)
def test_faulty_file_is_named(tree: Path, name: str, content: bytes | None, message: str) -> None:
    break_file(tree, name, content)
    with pytest.raises(DataError, match=f"sequences/00/{name}.*{message}"):
        SemanticKITTI(tree).sweep(Frame("00", 1))


def test_oddly_named_scan_is_refused(tree: Path) -> None:
    (tree / "sequences/00/velodyne/12.bin").write_bytes(bytes(16))
    with pytest.raises(DataError, match=r"12\.bin: expected a name of six digits, found '12'"):
        SemanticKITTI(tree).frames_of("00")


def test_empty_scan_folder_is_told(tree: Path) -> None:
    for path in (tree / "sequences/08/velodyne").iterdir():
        path.unlink()
    with pytest.raises(DataError, match=r"08/velodyne: expected scans 000000\.bin"):
        SemanticKITTI(tree).frames("val")


def test_sources_need_every_label(tree: Path) -> None:
    break_file(tree, "labels/000002.label", None)
    with pytest.raises(DataError, match=r"000002\.label: expected a file beside the sequence's 4 scans, found none"):
        SemanticKITTI(tree).sources("00")


def test_an_empty_scan_is_a_scan(tree: Path) -> None:
    break_file(tree, "velodyne/000001.bin", b"")
    break_file(tree, "labels/000001.label", b"")
    sweep = SemanticKITTI(tree).sweep(Frame("00", 1))
    assert sweep.points.shape == (0, 4)
    assert torch.equal(sweep.labels, torch.zeros(0, dtype=torch.int64))  # type: ignore[arg-type]

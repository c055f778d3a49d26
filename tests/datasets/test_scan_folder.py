"""Folders of scans of any sensor: every format written by hand, in what order they come, and what is refused."""

import struct
from pathlib import Path

import numpy as np
import pytest
import torch

from most.datasets.pose_files import read_pose_file
from most.datasets.scan_folder import ScanFolder, ScanFolderSettings
from most.errors import ConfigError, DataError

POINTS = np.array([[1.5, -2, 0.25, 0.5], [np.nan, 4, 5, 0], [7, 8, -9, 1]], "<f4")
IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0\n"
PLY_HEADER = (
    "ply\nformat {kind} 1.0\ncomment by hand\nelement vertex {count}\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty float Intensity\nend_header\n"
)
PLY_ROW = np.dtype([("xyz", "<f4", 3), ("red", "u1"), ("intensity", "<f4")])
PCD_HEADER = (
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z ring intensity\nSIZE 4 4 4 2 4\nTYPE F F F U F\nCOUNT 1 1 1 1 1\n"
    "WIDTH {count}\nHEIGHT 1\nVIEWPOINT 9 9 9 1 0 0 0\nPOINTS {count}\nDATA {kind}\n"
)
PCD_ROW = np.dtype([("xyz", "<f4", 3), ("ring", "<u2"), ("intensity", "<f4")])


def rows(dtype: np.dtype, points: np.ndarray = POINTS) -> np.ndarray:
    """The points as records with one more field."""
    table = np.zeros(len(points), dtype)
    table["xyz"], table["intensity"] = points[:, :3], points[:, 3]
    return table


def as_text(points: np.ndarray = POINTS) -> str:
    return "".join(f"{x:.9g} {y:.9g} {z:.9g} 7 {w:.9g}\n" for x, y, z, w in points)


def write_bin(path: Path) -> None:
    path.write_bytes(POINTS.tobytes())


def write_npy(path: Path) -> None:
    np.save(path, np.hstack([POINTS.astype(np.float64), np.full((3, 2), 77.0)]))


def write_ply(path: Path) -> None:
    path.write_bytes(PLY_HEADER.format(kind="binary_little_endian", count=3).encode() + rows(PLY_ROW).tobytes())


def write_big_endian_ply(path: Path) -> None:
    table = rows(PLY_ROW).astype(PLY_ROW.newbyteorder(">"))
    path.write_bytes(PLY_HEADER.format(kind="binary_big_endian", count=3).encode() + table.tobytes())


def write_ascii_ply(path: Path) -> None:
    path.write_text(PLY_HEADER.format(kind="ascii", count=3) + as_text())


def write_pcd(path: Path) -> None:
    path.write_bytes(PCD_HEADER.format(kind="binary", count=3).encode() + rows(PCD_ROW).tobytes())


def write_ascii_pcd(path: Path) -> None:
    path.write_text(PCD_HEADER.format(kind="ascii", count=3) + as_text())


def write_compressed_pcd(path: Path) -> None:
    """Fields one after the other, in LZF whose only instructions are literal runs."""
    table = rows(PCD_ROW)
    fields = [*table["xyz"].T, table["ring"], table["intensity"]]
    plain = b"".join(np.ascontiguousarray(field).tobytes() for field in fields)
    packed = b"".join(bytes([len(plain[i : i + 32]) - 1]) + plain[i : i + 32] for i in range(0, len(plain), 32))
    header = PCD_HEADER.format(kind="binary_compressed", count=3).encode()
    path.write_bytes(header + struct.pack("<II", len(packed), len(plain)) + packed)


WRITERS = {
    "a.bin": write_bin, "a.npy": write_npy, "a.ply": write_ply, "b.ply": write_big_endian_ply, "c.ply": write_ascii_ply,
    "a.pcd": write_pcd, "b.pcd": write_ascii_pcd, "C.PCD": write_compressed_pcd,
}  # fmt: skip


def write(path: Path) -> Path:
    """Write the three points in the format that the name stands for; skip where its library is absent."""
    if path.suffix.lower() == ".pcd":
        pytest.importorskip("pypcd4", reason="reading .pcd takes the extra pcd")
    WRITERS[path.name](path)
    return path


def folder_of(path: Path, **settings) -> ScanFolder:
    with pytest.warns(UserWarning, match="no poses: earlier sweeps are not accumulated"):
        return ScanFolder(path, ScanFolderSettings(**settings))


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_points(tmp_path, name):
    write(tmp_path / name)
    (scan,) = folder_of(tmp_path)
    assert scan.name == name[0]
    torch.testing.assert_close(scan.points, torch.from_numpy(POINTS), equal_nan=True, rtol=0, atol=0)


@pytest.mark.parametrize("name", ["a.npy", "a.ply", "c.ply", "a.pcd", "b.pcd"])
def test_without_intensity_it_is_zero(tmp_path, name):
    path = write(tmp_path / name)
    if name == "a.npy":
        np.save(path, POINTS[:, :3])
    else:
        path.write_bytes(path.read_bytes().replace(b"ntensity", b"ntentions"))
    (scan,) = folder_of(tmp_path)
    assert scan.points[:, 3].tolist() == [0, 0, 0]
    assert scan.points[2, :3].tolist() == [7, 8, -9]


@pytest.mark.parametrize(("columns", "intensity"), [(3, [0, 0]), (5, [0.5, 1])])
def test_a_bin_has_as_many_columns_as_one_says(tmp_path, columns, intensity):
    table = np.array([[1, 2, 3, 0.5, 30], [4, 5, 6, 1, 31]], "<f4")[:, :columns]
    table.tofile(tmp_path / "0.bin")
    (scan,) = folder_of(tmp_path, columns=columns)
    assert scan.points.tolist() == [[1, 2, 3, intensity[0]], [4, 5, 6, intensity[1]]]


def test_intensities_are_divided_by_the_scale_cut_off_and_told_of_once(tmp_path):
    for name in "01":
        np.array([[0, 0, 0, 51], [0, 0, 0, 510], [0, 0, 0, np.nan], [0, 0, 0, np.inf]], "<f4").tofile(
            tmp_path / f"{name}.bin"
        )
    scans = folder_of(tmp_path, intensity_scale=255)
    with pytest.warns(UserWarning, match=r"0\.bin: expected .*intensity_scale=255, found 510") as told:
        found = [scan.points[:, 3].tolist() for scan in scans]
    assert found == [pytest.approx([0.2, 1, 0, 0])] * 2
    assert len(told) == 1


def test_scans_come_by_the_numbers_in_their_names_and_other_files_are_left_alone(tmp_path):
    for name in ("scan10.bin", "scan2.npy", "scan1.bin", "b.bin"):
        (np.save if name.endswith("npy") else lambda path, rows: rows.tofile(path))(tmp_path / name, POINTS)
    for name in ("notes.txt", ".scan3.bin.x.part", ".scan4.bin"):
        (tmp_path / name).write_text("no scan")
    (tmp_path / "scan5.bin").mkdir()
    scans = folder_of(tmp_path, period=0.5)
    assert len(scans) == 4
    assert [(scan.name, scan.time, scan.pose) for scan in scans] == [
        ("b", 0, None), ("scan1", 0.5, None), ("scan2", 1, None), ("scan10", 1.5, None),
    ]  # fmt: skip


def test_each_file_is_read_once_when_its_turn_comes(tmp_path, monkeypatch):
    for name in ("0.bin", "1.bin"):
        write_bin(tmp_path / name)
    scans, read, bytes_of = folder_of(tmp_path), [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.append(path.name) or bytes_of(path))
    stream = iter(scans)
    assert read == []
    next(stream)
    assert read == ["0.bin"]
    next(stream)
    assert read == ["0.bin", "1.bin"]


@pytest.mark.parametrize("name", ["0.bin", "0.npy", "a.ply", "c.ply", "a.pcd", "b.pcd"])
def test_an_empty_scan_is_a_scan(tmp_path, name):
    path = tmp_path / name
    if name == "0.npy":
        np.save(path, np.zeros((0, 3)))
    elif name == "0.bin":
        path.touch()
    else:
        header = write(path).read_bytes()
        end = b"end_header\n" if path.suffix == ".ply" else b"ascii\n" if name == "b.pcd" else b"binary\n"
        header = header[: header.index(end) + len(end)].replace(b"vertex 3", b"vertex 0")
        path.write_bytes(header.replace(b"WIDTH 3", b"WIDTH 0").replace(b"POINTS 3", b"POINTS 0"))
    (scan,) = folder_of(tmp_path)
    assert scan.points.shape == (0, 4)


@pytest.mark.parametrize("name", ["c.ply", "b.pcd"])
def test_a_scan_may_be_a_single_point(tmp_path, name):
    path = write(tmp_path / name)
    text = (
        path.read_text().replace("vertex 3", "vertex 1").replace("WIDTH 3", "WIDTH 1").replace("POINTS 3", "POINTS 1")
    )
    path.write_text("".join(text.splitlines(keepends=True)[:-2]))
    (scan,) = folder_of(tmp_path)
    assert scan.points.tolist() == [[1.5, -2, 0.25, 0.5]]


def test_poses_and_times_stand_row_by_row_beside_the_scans(tmp_path):
    for name in ("0.bin", "1.bin"):
        write_bin(tmp_path / name)
    poses, times = tmp_path / "poses.txt", tmp_path / "times.txt"
    poses.write_text("# a comment\n" + IDENTITY + "0 -1 0 5  1 0 0 6  0 0 1 7\n")
    times.write_text("3.5\n3.75\n")
    first, second = ScanFolder(tmp_path, ScanFolderSettings(poses=str(poses), times=str(times)))
    assert torch.equal(first.pose, torch.eye(4, dtype=torch.float64))
    assert second.pose.tolist() == [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]
    assert (first.time, second.time) == (3.5, 3.75)


def test_poses_of_tum_bring_their_times(tmp_path):
    for name in ("0.bin", "1.bin"):
        write_bin(tmp_path / name)
    poses = tmp_path / "tum.txt"
    poses.write_text("12.5 5 6 7 0 0 1 1\n12.75 0 0 0 0 0 0 2\n")  # a quarter turn to the left; then none
    first, second = ScanFolder(tmp_path, ScanFolderSettings(poses=str(poses)))
    expected = torch.tensor([[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]], dtype=torch.float64)
    torch.testing.assert_close(first.pose, expected)
    torch.testing.assert_close(second.pose, torch.eye(4, dtype=torch.float64))
    assert (first.time, second.time) == (12.5, 12.75)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (IDENTITY, r"poses\.txt: expected poses of the 2 scans .* found 1"),
        (IDENTITY * 3, r"poses\.txt: expected poses of the 2 scans .* found 3"),
        ("", r"poses\.txt: expected poses of the 2 scans .* found 0"),
        ("1 2 3\n", r"poses\.txt, line 1: expected 12 numbers .* or 8 .* found 3"),
        (IDENTITY + "1 2\n", r"poses\.txt, line 2: expected 12 finite"),
        (IDENTITY.replace("1", "2") * 2, r"poses\.txt: expected rotations"),
        ("0 0 0 0 0 0 0 0\n" * 2, r"poses\.txt: expected a quaternion .* row 0"),
        ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", r"poses\.txt, line 2 \(scan 1, .* expected a time after 2 s, found 1 s"),
        (
            "# of a drive\n1695123456.25 0 0 0 0 0 0 1\n# twice\n1695123456.25 0 0 0 0 0 0 1\n",
            r"poses\.txt, line 4 \(scan 1, .* expected a time after 1695123456.25 s, found 1695123456.25 s",
        ),
        (
            "1695123456000000000 0 0 0 0 0 0 1\n1695123456100000000 0 0 0 0 0 0 1\n",
            r"poses\.txt: expected seconds, found steps of 100000000 .* nanoseconds, divide them by 1e9",
        ),
    ],
)
def test_poses_that_do_not_fit_are_refused(tmp_path, content, message):
    for name in ("0.bin", "1.bin"):
        write_bin(tmp_path / name)
    (tmp_path / "poses.txt").write_text(content)
    with pytest.raises(DataError, match=message):
        ScanFolder(tmp_path, ScanFolderSettings(poses=str(tmp_path / "poses.txt")))


def test_missing_poses_and_too_few_times_are_refused(tmp_path):
    write_bin(tmp_path / "0.bin")
    with pytest.raises(DataError, match=r"none\.txt: expected a file of poses"):
        read_pose_file(tmp_path / "none.txt")
    (tmp_path / "times.txt").write_text("1\n2\n")
    with (
        pytest.warns(UserWarning, match="no poses"),
        pytest.raises(DataError, match=r"times\.txt: expected times of the 1 scans .* found 2"),
    ):
        ScanFolder(tmp_path, ScanFolderSettings(times=str(tmp_path / "times.txt")))


def test_times_in_milliseconds_are_refused(tmp_path):
    for name in "012":
        write_bin(tmp_path / f"{name}.bin")
    (tmp_path / "times.txt").write_text("0\n100\n200\n")
    with (
        pytest.warns(UserWarning, match="no poses"),
        pytest.raises(DataError, match=r"times\.txt: expected seconds, found steps of 100 from scan to scan"),
    ):
        ScanFolder(tmp_path, ScanFolderSettings(times=str(tmp_path / "times.txt")))


@pytest.mark.parametrize(
    "names", [["0.1", "0.15", "0.2", "1.0"], ["9.5", "10", "10.25"], ["1700000000.05", "1700000000.5"], ["a2", "a10.1"]]
)
def test_names_that_are_times_are_ordered_by_value(tmp_path, names):
    for name in reversed(names):
        write_bin(tmp_path / f"{name}.bin")
    assert [scan.name for scan in folder_of(tmp_path)] == names


def test_a_cut_off_bin_is_told_of_before_any_scan_is_read(tmp_path):
    for name in ("0.bin", "1.bin"):
        write_bin(tmp_path / name)
    (tmp_path / "1.bin").write_bytes(POINTS.tobytes()[:-1])
    with pytest.raises(DataError, match=r"1\.bin: expected a multiple of 16 bytes"):
        folder_of(tmp_path)


def refuse(path: Path, message: str) -> None:
    """Reading the folder ends in a message that names the file."""
    with pytest.raises(DataError, match=rf"{path.name.replace('.', chr(92) + '.')}: .*{message}"):
        list(folder_of(path.parent))


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("left", [1, 3])
def test_files_cut_off_are_refused(tmp_path, name, left):
    path = write(tmp_path / name)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * left // 4 + 1])
    refuse(path, "")


def test_a_whole_row_cut_off_is_missed_too(tmp_path):
    for name, size in {"a.ply": PLY_ROW.itemsize, "a.pcd": PCD_ROW.itemsize}.items():
        folder = tmp_path / name[2:]
        folder.mkdir()
        path = write(folder / name)
        path.write_bytes(path.read_bytes()[:-size])
        refuse(path, "cut off")


def test_the_size_of_a_bin_tells_which_columns_would_fit(tmp_path):
    path = tmp_path / "0.bin"
    np.zeros((3, 5), "<f4").tofile(path)
    refuse(path, r"multiple of 16 .* found 60; give scans\.columns=3 or 5")


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((4, 2)), r"expected a row x, y, z .* found shape \(4, 2\)"),
        (np.zeros(12), r"found shape \(12,\)"),
        (np.zeros((4, 3), np.complex64), "expected an .npy array of numbers, found complex64"),
        (np.array([[1, 2, 3]], object), "expected an .npy array of numbers, found none readable"),
    ],
)
def test_arrays_that_are_no_scan_are_refused(tmp_path, array, message):
    np.save(tmp_path / "0.npy", array, allow_pickle=True)
    refuse(tmp_path / "0.npy", message)


@pytest.mark.parametrize("name", ["0.npy", "0.ply", "0.pcd"])
@pytest.mark.parametrize("content", [b"", b"\n", b"no scan at all\n", b"ply\n\n", b"PK\3\4garbage", bytes(range(256))])
def test_other_files_are_refused(tmp_path, name, content):
    if name.endswith("pcd"):
        pytest.importorskip("pypcd4", reason="reading .pcd takes the extra pcd")
    (tmp_path / name).write_bytes(content)
    refuse(tmp_path / name, "expected")


@pytest.mark.parametrize("end", range(5, 45, 3))
def test_an_ascii_ply_cut_off_anywhere_is_refused(tmp_path, end):
    path = write(tmp_path / "c.ply")
    path.write_bytes(path.read_bytes()[:-end])
    refuse(path, "expected")


@pytest.mark.parametrize(
    ("old", "new"), [(b"'descr'", b"'descr"), (b"False", b"F(((("), (b"<f8", b"<f9"), (b"(3, 6)", b"(-3, 6)")]
)
def test_damaged_headers_of_arrays_are_refused(tmp_path, old, new):
    content = write(path := tmp_path / "a.npy").read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new))
    refuse(path, "expected an .npy array of numbers")


def test_clouds_without_coordinates_are_refused(tmp_path):
    path = write(tmp_path / "a.ply")
    path.write_bytes(path.read_bytes().replace(b"float z", b"float w"))
    refuse(path, "")


@pytest.mark.parametrize(
    ("names", "message"),
    [([], "found no files"), (["a.txt", "b.las"], r"expected scans \(\.bin, .*\), found \.las, \.txt")],
)
def test_folders_without_scans_are_refused(tmp_path, names, message):
    for name in names:
        (tmp_path / name).touch()
    with pytest.raises(DataError, match=message):
        ScanFolder(tmp_path)
    with pytest.raises(DataError, match="expected a folder of scans, found none"):
        ScanFolder(tmp_path / "there")


def test_two_scans_of_one_name_are_refused(tmp_path):
    write_bin(tmp_path / "a.bin")
    write_npy(tmp_path / "a.npy")
    with pytest.raises(DataError, match=r"expected one scan of each name, found several a\.\*"):
        ScanFolder(tmp_path)


def test_without_the_library_a_pcd_names_the_extra(tmp_path, monkeypatch):
    (tmp_path / "a.pcd").touch()
    monkeypatch.setitem(__import__("sys").modules, "pypcd4", None)
    with pytest.raises(ConfigError, match=r"a\.pcd: .*pip install 'most-lidar\[pcd\]'"):
        list(folder_of(tmp_path))


@pytest.mark.parametrize(
    "values", [{"columns": 2}, {"intensity_scale": 0.0}, {"period": float("nan")}, {"period": 100.0}]
)
def test_settings_out_of_range_are_refused(values):
    with pytest.raises(ConfigError, match=f"scans.{next(iter(values))}: expected"):
        ScanFolderSettings(**values)

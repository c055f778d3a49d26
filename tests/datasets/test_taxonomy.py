from pathlib import Path

import pytest
import torch
import yaml

from most.datasets.taxonomy import TAXONOMIES, Taxonomy
from most.errors import ConfigError, DataError

# The official single-scan class map: raw id -> training id.
OFFICIAL = {0: 0, 1: 0, 52: 0, 99: 0, 10: 1, 252: 1, 11: 2, 15: 3, 18: 4, 258: 4, 20: 5, 13: 5, 16: 5, 256: 5, 257: 5}
OFFICIAL |= {259: 5, 30: 6, 254: 6, 31: 7, 253: 7, 32: 8, 255: 8, 40: 9, 60: 9, 44: 10, 48: 11, 49: 12, 50: 13, 51: 14}
OFFICIAL |= {70: 15, 71: 16, 72: 17, 80: 18, 81: 19}
WRITTEN = [0, 10, 11, 15, 18, 20, 30, 31, 32, 40, 44, 48, 49, 50, 51, 70, 71, 72, 80, 81]


@pytest.fixture
def taxonomy() -> Taxonomy:
    return Taxonomy.load("semantickitti")


def test_semantickitti_is_the_official_class_map(taxonomy: Taxonomy) -> None:
    raw = torch.arange(359)
    expected = torch.tensor([OFFICIAL.get(index, 0) for index in range(359)])
    assert torch.equal(taxonomy.to_training(raw), expected)
    assert taxonomy.to_raw(torch.arange(20)).tolist() == WRITTEN
    assert (taxonomy.num_classes, taxonomy.min_points) == (20, 50)
    assert taxonomy.things == list(range(1, 9))
    assert taxonomy.stuff == list(range(9, 20))
    assert taxonomy.is_thing(torch.arange(20)).tolist() == [1 <= index <= 8 for index in range(20)]
    assert taxonomy.class_names[1] == "car"
    assert taxonomy.colours[9] == [255, 0, 255]


def test_instance_numbers_do_not_disturb_classes(taxonomy: Taxonomy) -> None:
    raw = torch.tensor([(65535 << 16) | 252, (1 << 16) | 30, 81])
    assert taxonomy.to_training(raw).tolist() == [1, 6, 19]
    assert taxonomy.instance_of(raw).tolist() == [65535, 1, 0]


def test_encode_is_read_back(taxonomy: Taxonomy) -> None:
    semantics, ids = torch.tensor([1, 8, 19, 0]), torch.tensor([65535, 2, 0, 0])
    raw = taxonomy.encode(semantics, ids)
    assert raw.tolist() == [(65535 << 16) | 10, (2 << 16) | 32, 81, 0]
    assert torch.equal(taxonomy.to_training(raw), semantics)
    assert torch.equal(taxonomy.instance_of(raw), ids)


@pytest.mark.parametrize("ids", [[65536], [-1]])
def test_instance_number_that_does_not_fit_is_refused(taxonomy: Taxonomy, ids: list[int]) -> None:
    with pytest.raises(DataError, match=rf"instance ids: expected 0\.\.65535, found {ids[0]}"):
        taxonomy.encode(torch.tensor([1]), torch.tensor(ids))


def test_raw_id_outside_the_table_is_refused(taxonomy: Taxonomy) -> None:
    with pytest.raises(DataError, match=r"000001\.label: expected raw class ids 0\.\.358 .*, found 359"):
        taxonomy.to_training(torch.tensor([10, 359]), "000001.label")


def test_no_points_are_fine(taxonomy: Taxonomy) -> None:
    none = torch.zeros(0, dtype=torch.int64)
    assert taxonomy.to_training(none).shape == taxonomy.encode(none, none).shape == (0,)


def test_unknown_name_lists_the_known() -> None:
    with pytest.raises(ConfigError, match=r"expected one of .*semantickitti.*, found 'kitti'"):
        Taxonomy.load("kitti")


@pytest.mark.parametrize("path", sorted(TAXONOMIES.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_taxonomy_file_holds_together(path: Path) -> None:
    taxonomy = Taxonomy.load(path.stem)
    ids = torch.arange(taxonomy.num_classes)
    assert taxonomy.name == path.stem
    assert sorted([0, *taxonomy.things, *taxonomy.stuff]) == ids.tolist()
    assert len({tuple(colour) for colour in taxonomy.colours}) == len(set(taxonomy.class_names)) == len(ids)
    assert torch.equal(taxonomy.to_training(taxonomy.to_raw(ids)), ids)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"min_points": "50"}, "min_points: expected int, found '50'"),
        ({"min_points": None}, "min_points: expected int, found None"),
        ({"classes": [{"name": "void"}]}, r"classes\[0\]: expected the keys name, kind, raw, colour"),
        ({"kind": "stuff"}, r"classes\[0\]\.kind: expected void, found 'stuff'"),
        ({"raw": [9]}, r"classes\[0\]\.raw: expected ids in 0\.\.3, found \[9\]"),
        ({"raw": []}, r"classes\[0\]\.raw"),
        ({"raw": [1]}, "raw id 1: expected one class, found void and car"),
        ({"colour": [0, 0, 256]}, r"classes\[0\]\.colour: expected three numbers in 0\.\.255"),
    ],
)
def test_faulty_file_is_refused(tmp_path: Path, change: dict, message: str) -> None:
    void = {"name": "void", "kind": "void", "raw": [0], "colour": [0, 0, 0]}
    car = {"name": "car", "kind": "thing", "raw": [1], "colour": [1, 1, 1]}
    top = {key: value for key, value in change.items() if key not in void}
    inner = {key: value for key, value in change.items() if key in void}
    content = {"name": "toy", "min_points": 5, "raw_table_size": 4, "classes": [void | inner, car]} | top
    path = tmp_path / "toy.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(DataError, match=f"toy.yaml: {message}"):
        Taxonomy.read(path)


def test_file_that_is_no_mapping_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "toy.yaml"
    path.write_text("[1, 2]")
    with pytest.raises(DataError, match=r"toy\.yaml: expected a mapping, found list"):
        Taxonomy.read(path)

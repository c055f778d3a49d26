from pathlib import Path

import pytest
import torch
import yaml

from most.datasets.taxonomy import TAXONOMIES, Taxonomy, fit_numbers
from most.errors import ConfigError, DataError

# The official single-scan class map: raw id -> training id.
OFFICIAL = {0: 0, 1: 0, 52: 0, 99: 0, 10: 1, 252: 1, 11: 2, 15: 3, 18: 4, 258: 4, 20: 5, 13: 5, 16: 5, 256: 5, 257: 5}
OFFICIAL |= {259: 5, 30: 6, 254: 6, 31: 7, 253: 7, 32: 8, 255: 8, 40: 9, 60: 9, 44: 10, 48: 11, 49: 12, 50: 13, 51: 14}
OFFICIAL |= {70: 15, 71: 16, 72: 17, 80: 18, 81: 19}
# The official map of the 32 categories of nuScenes to the 16 classes of its tasks.
NUSCENES = [0, 0, 7, 7, 7, 0, 7, 0, 0, 1, 0, 0, 8, 0, 2, 3, 3, 4, 5, 0, 0, 6, 9, 10, 11, 12, 13, 14, 15, 0, 16, 0]
WRITTEN = [0, 10, 11, 15, 18, 20, 30, 31, 32, 40, 44, 48, 49, 50, 51, 70, 71, 72, 80, 81]


@pytest.fixture
def taxonomy() -> Taxonomy:
    return Taxonomy.load("semantickitti")


def test_semantickitti_is_the_official_class_map(taxonomy: Taxonomy) -> None:
    raw = torch.arange(359)
    expected = torch.tensor([OFFICIAL.get(index, 0) for index in range(359)])
    assert torch.equal(taxonomy.to_training(raw), expected)
    assert taxonomy.encode(torch.arange(20), torch.zeros(20, dtype=torch.int64)).tolist() == WRITTEN
    assert (taxonomy.num_classes, taxonomy.min_points) == (20, 50)
    assert taxonomy.things == list(range(1, 9))
    assert taxonomy.stuff == list(range(9, 20))
    assert taxonomy.is_thing(torch.arange(20)).tolist() == [1 <= index <= 8 for index in range(20)]
    assert taxonomy.class_names[1] == "car"
    assert taxonomy.colours[9] == [255, 0, 255]


def test_nuscenes_is_the_official_class_map() -> None:
    taxonomy = Taxonomy.load("nuscenes")
    assert taxonomy.to_training(1000 * torch.arange(32) + 999).tolist() == NUSCENES
    assert (taxonomy.num_classes, taxonomy.min_points) == (17, 15)
    assert (taxonomy.things, taxonomy.stuff) == (list(range(1, 11)), list(range(11, 17)))
    assert (taxonomy.class_names[4], taxonomy.class_names[11]) == ("car", "driveable_surface")
    assert taxonomy.gates == [0, 1, 3, 5.5, 4, 4, 13, 1, 1, 3, 4, 0, 0, 0, 0, 0, 0]
    with pytest.raises(DataError, match=r"expected raw class ids 0\.\.31 of nuscenes, found 32"):
        taxonomy.to_training(torch.tensor([32000]))


def test_nuscenes_predictions_hold_training_ids() -> None:
    taxonomy = Taxonomy.load("nuscenes")
    semantics, ids = torch.tensor([4, 7, 16, 0]), torch.tensor([999, 1, 0, 0])
    labels = taxonomy.encode(semantics, ids)
    assert labels.tolist() == [4999, 7001, 16000, 0]
    assert torch.equal(taxonomy.decode(labels), semantics)
    assert torch.equal(taxonomy.instance_of(labels), ids)
    with pytest.raises(DataError, match=r"expected predicted class ids 0\.\.16 of nuscenes, found 17"):
        taxonomy.decode(torch.tensor([17001]))
    assert taxonomy.encode(torch.tensor([4]), torch.tensor([1000])).tolist() == [4001]


def test_instance_numbers_do_not_disturb_classes(taxonomy: Taxonomy) -> None:
    raw = torch.tensor([(65535 << 16) | 252, (1 << 16) | 30, 81])
    assert taxonomy.to_training(raw).tolist() == [1, 6, 19]
    assert taxonomy.instance_of(raw).tolist() == [65535, 1, 0]


def test_encode_is_read_back(taxonomy: Taxonomy) -> None:
    semantics, ids = torch.tensor([1, 8, 19, 0]), torch.tensor([65535, 2, 0, 0])
    raw = taxonomy.encode(semantics, ids)
    assert raw.tolist() == [(65535 << 16) | 10, (2 << 16) | 32, 81, 0]
    assert torch.equal(taxonomy.decode(raw), semantics)
    assert torch.equal(taxonomy.instance_of(raw), ids)


def test_a_negative_instance_number_is_refused(taxonomy: Taxonomy) -> None:
    with pytest.raises(DataError, match="instance ids: expected numbers >= 0, found -1"):
        taxonomy.encode(torch.tensor([1]), torch.tensor([-1]))


def test_raw_id_outside_the_table_is_refused(taxonomy: Taxonomy) -> None:
    with pytest.raises(DataError, match=r"000001\.label: expected raw class ids 0\.\.358 .*, found 359"):
        taxonomy.to_training(torch.tensor([10, 359]), "000001.label")


def test_no_points_are_fine(taxonomy: Taxonomy) -> None:
    none = torch.zeros(0, dtype=torch.int64)
    assert taxonomy.to_training(none).shape == taxonomy.encode(none, none).shape == (0,)


@pytest.mark.parametrize("name", ["kitti", "../taxonomies/nuscenes", "./nuscenes", ""])
def test_unknown_name_lists_the_known(name: str) -> None:
    with pytest.raises(ConfigError, match=rf"expected one of nuscenes, semantickitti, found '{name}'"):
        Taxonomy.load(name)


@pytest.mark.parametrize("path", sorted(TAXONOMIES.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_taxonomy_file_holds_together(path: Path) -> None:
    taxonomy = Taxonomy.load(path.stem)
    ids = torch.arange(taxonomy.num_classes)
    assert taxonomy.name == path.stem
    assert sorted([0, *taxonomy.things, *taxonomy.stuff]) == ids.tolist()
    assert len({tuple(colour) for colour in taxonomy.colours}) == len(set(taxonomy.class_names)) == len(ids)
    assert torch.equal(taxonomy.decode(taxonomy.encode(ids, torch.ones_like(ids))), ids)
    firsts = torch.tensor([raw[0] for raw in taxonomy.raw_ids])
    assert torch.equal(taxonomy.to_training(taxonomy.label.join(firsts, torch.ones_like(ids))), ids)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"min_points": "50"}, "min_points: expected int, found '50'"),
        ({"min_points": None}, "min_points: expected int, found None"),
        ({"label": {"high": "colour", "step": 10}}, "label.high: expected class or instance, found 'colour'"),
        ({"label": {"high": "class", "step": 1, "unique_in": "class"}}, "label.step: expected a number above 1"),
        ({"label": {"high": "class", "step": 9}}, "label.unique_in: expected class or sequence, found None"),
        ({"label": 1000}, "label: expected dict, found 1000"),
        ({"predicted_as": "colour"}, "predicted_as: expected raw or training, found 'colour'"),
        ({"evaluator": "waymo"}, "evaluator: expected semantickitti or nuscenes, found 'waymo'"),
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
    car = {"name": "car", "kind": "thing", "raw": [1], "colour": [1, 1, 1], "gate": 4, "box": [4, 2]}
    top = {key: value for key, value in change.items() if key not in void}
    inner = {key: value for key, value in change.items() if key in void}
    label = {"high": "class", "step": 10, "unique_in": "class"}
    content = {"name": "toy", "min_points": 5, "raw_table_size": 4, "label": label, "predicted_as": "raw"}
    content |= {"evaluator": "nuscenes", "classes": [void | inner, car]} | top
    path = tmp_path / "toy.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(DataError, match=f"toy.yaml: {message}"):
        Taxonomy.read(path)


@pytest.mark.parametrize(("gate", "message"), [
    (None, "expected the keys name, kind, raw, colour, gate, box"), (0, "gate: expected metres above 0, found 0"),
    ("4", "gate: expected metres above 0, found '4'"),
])  # fmt: skip
def test_a_thing_without_a_gate_is_refused(tmp_path: Path, gate: object, message: str) -> None:
    content = yaml.safe_load((TAXONOMIES / "semantickitti.yaml").read_text())
    content["classes"][1] = {key: value for key, value in content["classes"][1].items() if key != "gate"}
    content["classes"][1] |= {} if gate is None else {"gate": gate}
    path = tmp_path / "toy.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(DataError, match=message):
        Taxonomy.read(path)


def test_file_that_is_no_mapping_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "toy.yaml"
    path.write_text("[1, 2]")
    with pytest.raises(DataError, match=r"toy\.yaml: expected a mapping, found list"):
        Taxonomy.read(path)


def test_more_instances_than_the_format_holds_are_numbered_by_size_in_each_class():
    """Three cars of 1, 3 and 2 points and a person, where two numbers fit: the smaller cars share the second."""
    semantics = torch.tensor([1, 1, 1, 1, 1, 1, 6, 9])
    ids = torch.tensor([70, 80, 80, 80, 90, 90, 80, 0])
    assert fit_numbers(semantics, ids, largest=2).tolist() == [2, 1, 1, 1, 2, 2, 1, 0]


def test_a_submission_takes_any_number_of_instances():
    taxonomy = Taxonomy.load("nuscenes")
    ids = torch.arange(1, 1500)
    labels = taxonomy.encode(torch.full_like(ids, taxonomy.things[0]), ids)
    numbers = taxonomy.instance_of(labels)
    assert (int(numbers.min()), int(numbers.max())) == (1, 999)
    assert (taxonomy.decode(labels) == taxonomy.things[0]).all()

"""Checkpoints: what is loaded is what was saved, and whatever else a file holds is refused unexecuted."""

import math
import pickle
from pathlib import Path

import pytest
import torch

from most.assembly import FORMAT, check_taxonomy, describe, exchange_membership, load_trained
from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError, DataError
from most.heads import OffsetHead, OrientedCentreHead, SemanticHead, VoxelOffsets
from most.membership import Clustering, MeanShift, Nearest, PointSegMLPSettings
from most.modal.amodal import Amodal
from most.modal.extent import TrackMax
from most.modal.heatmap import HeatmapTargets
from tiny import CAR, TAXONOMY, cloud, street, tiny_parts, tiny_predictor, window

SAMPLES = [street(), window(cloud(40), cloud(20, 1))]


def checkpoint(predictor, **changes):
    """What training saves of a model: its description beside Lightning's own keys."""
    parts = predictor.modules().items()
    state = {f"{name}.{key}": value for name, part in parts for key, value in part.state_dict().items()}
    description = describe(tiny_parts(**changes), TAXONOMY, sweeps=1)
    return {"epoch": 3, "state_dict": state | {"quality.tp": torch.zeros(20)}, "most": description, "most_run": {}}


def save(folder: Path, content) -> Path:
    path = folder / "some.ckpt"
    torch.save(content, path)
    return path


def tensors(prediction):
    found = [*vars(prediction.panoptic).values(), *vars(prediction.detections).values(), prediction.roi]
    return [value.nan_to_num(-99.0) for value in found if value is not None]  # velocities of clusters are NaN


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"backbone": AsymmetricUNetSettings(widths=[4, 4, 8, 8], bev_channels=8)},
        {"backbone": ResidualUNetSettings(widths=[4, 4, 8, 8], bev_channels=4), "semantic_head": SemanticHead(False)},
        {"membership": PointSegMLPSettings([4])},
        {"centre_head": OrientedCentreHead(channels=8)},
        {"membership": Clustering(margin=1.5)},
        {"centre_head": OffsetHead(8), "membership": MeanShift(0.9)},
        {"backbone": ResidualUNetSettings(widths=[4, 4, 8, 8], bev_channels=4, separate=True)},
        {
            "backbone": AsymmetricUNetSmallSettings(widths=[4, 4, 8, 8], bev_channels=4, separate=True),
            "membership": PointSegMLPSettings([4]),
        },
    ],
)
def test_a_loaded_model_predicts_bit_for_bit_what_the_saved_one_did(tmp_path, changes):
    predictor = tiny_predictor(**changes)
    predictor.network(SAMPLES)  # moves the batch statistics from where they start
    predictor.network.semantic_head.voxel.bias.data[CAR - 1] += 2.0  # for some cars
    if not isinstance(predictor.network.centre_head, VoxelOffsets):
        predictor.network.centre_head.heatmap.bias.data += 2.0  # for some detections
    for part in predictor.modules().values():
        part.eval()
    trained = load_trained(save(tmp_path, checkpoint(predictor, **changes)))
    assert (trained.sweeps, trained.taxonomy) == (1, TAXONOMY)
    assert not trained.predictor.network.training
    before, after = predictor(SAMPLES), trained.predictor(SAMPLES)
    assert any(len(one.detections) > 0 for one in before)
    for one, other in zip(before, after, strict=True):
        assert all(torch.equal(*pair) for pair in zip(tensors(one), tensors(other), strict=True))


DRAWN = {"kind": "gaussian_radius", "min_variance": 1.0, "min_overlap": 0.2, "min_radius": 3, "min_points": 5}


@pytest.mark.parametrize(
    ("told", "targets"),
    [
        ({"most_run": {"stage": "detection", "training": {"targets": DRAWN}}}, HeatmapTargets(**DRAWN)),
        (
            {
                "most_run": {"stage": "membership", "training": {}},
                "most_stage1": {"stage": "detection", "training": {"targets": DRAWN}},
            },
            HeatmapTargets(**DRAWN),
        ),
        ({"most_run": {"stage": "membership", "training": {}}}, None),  # of a time when stage 2 did not say
    ],
)
def test_a_checkpoint_of_either_stage_says_how_heat_maps_were_drawn(tmp_path, told, targets):
    trained = load_trained(save(tmp_path, checkpoint(tiny_predictor()) | told))
    assert trained.targets == targets
    if targets is None:
        with pytest.warns(UserWarning, match="does not say how heat maps were drawn: the default is taken"):
            assert trained.likely_targets() == HeatmapTargets()
    else:
        assert trained.likely_targets() == targets


BOXES = {"component": "amodal", "settings": {"floor": 0.1}}


@pytest.mark.parametrize(
    "told",
    [
        {"most_run": {"stage": "detection", "extent": BOXES}},
        {"most_run": {"stage": "membership"}, "most_stage1": {"stage": "detection", "extent": BOXES}},
    ],
)
def test_a_checkpoint_of_either_stage_says_how_large_instances_were(tmp_path, told):
    trained = load_trained(save(tmp_path, checkpoint(tiny_predictor()) | told))
    assert trained.extent == trained.likely_extent() == Amodal(floor=0.1)


def test_where_a_checkpoint_does_not_say_instances_are_as_large_as_their_tracks(tmp_path):
    trained = load_trained(save(tmp_path, checkpoint(tiny_predictor())))
    with pytest.warns(UserWarning, match="does not say how large instances were: track_max is taken"):
        assert trained.likely_extent() == TrackMax()


@pytest.mark.parametrize("extent", [{"component": "square"}, {"component": "amodal", "settings": {"floor": -1}}, 7])
def test_extents_that_cannot_be_are_refused(tmp_path, extent):
    run = {"stage": "detection", "extent": extent}
    with pytest.raises(DataError, match=r"some\.ckpt: expected a model that this version of most can make"):
        load_trained(save(tmp_path, checkpoint(tiny_predictor()) | {"most_run": run}))


@pytest.mark.parametrize("targets", [{"kind": "square"}, {"radius": 2}, 7])
def test_heat_maps_that_cannot_be_drawn_are_refused(tmp_path, targets):
    run = {"stage": "detection", "training": {"targets": targets}}
    with pytest.raises(DataError, match=r"some\.ckpt: expected a model that this version of most can make"):
        load_trained(save(tmp_path, checkpoint(tiny_predictor()) | {"most_run": run}))


def test_a_checkpoint_without_a_later_setting_has_its_default(tmp_path):
    content = checkpoint(tiny_predictor())
    del content["most"]["parts"]["backbone"]["settings"]["separate"]
    assert load_trained(save(tmp_path, content)).predictor.network.detection is None


def test_another_membership_without_training_is_put_on_the_same_network(tmp_path):
    trained = load_trained(save(tmp_path, checkpoint(tiny_predictor(membership=PointSegMLPSettings([4])),
                                                     membership=PointSegMLPSettings([4]))))  # fmt: skip
    for membership in (Nearest(), Clustering()):
        other = exchange_membership(trained, membership)
        assert other.predictor.network is trained.predictor.network
        assert set(other.predictor.modules()) == {"network"}
        other.predictor(SAMPLES)


@pytest.mark.parametrize(
    ("head", "membership", "message"),
    [
        ({}, PointSegMLPSettings(), "expected one without training, such as nearest, found one that stage 2 trains"),
        ({}, MeanShift(), "expected one that needs no offsets, as the model's heads are modal_centres, found mean_s"),
        ({"centre_head": OffsetHead(8), "membership": MeanShift()}, Nearest(), "needs no centres.*found nearest"),
    ],
)
def test_a_membership_that_does_not_fit_the_network_is_refused(tmp_path, head, membership, message):
    trained = load_trained(save(tmp_path, checkpoint(tiny_predictor(**head), **head)))
    with pytest.raises(ConfigError, match=message):
        exchange_membership(trained, membership)


def test_a_checkpoint_is_plain(tmp_path):
    path = save(tmp_path, checkpoint(tiny_predictor()))
    assert torch.load(path, weights_only=True)["most"]["parts"]["grid"]["settings"]["voxel_size"] == [0.5, 0.5, 0.5]


class Bomb:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_code_in_a_checkpoint_is_not_run(tmp_path):
    mark, armed = tmp_path / "ran", tmp_path / "armed.ckpt"
    for write in (torch.save, lambda content, path: path.write_bytes(pickle.dumps(content))):
        write(checkpoint(tiny_predictor()) | {"bomb": Bomb(mark)}, armed)
        with pytest.raises(DataError, match=r"armed\.ckpt: expected a checkpoint, found something else"):
            load_trained(armed)
        assert not mark.exists()
    pickle.loads(armed.read_bytes())
    assert mark.exists()  # it was armed


def test_a_checkpoint_cut_off_anywhere_is_refused(tmp_path):
    whole = save(tmp_path, checkpoint(tiny_predictor())).read_bytes()
    path = tmp_path / "part.ckpt"
    for end in [0, 1, 10, *range(30, len(whole), len(whole) // 60)]:
        path.write_bytes(whole[:end])
        with pytest.raises(DataError, match=r"part\.ckpt: expected a checkpoint, found .* truncated one; copy it"):
            load_trained(path)


@pytest.mark.parametrize("content", [b"name: most\n", b"hello", b".", b"0", b"(", b"\x80", b"hjunk", b"PK\x05\x06"])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"notes\.txt: expected a checkpoint, found something else"):
        load_trained(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(DataError, match="expected a checkpoint, found no file; train a model first"):
        load_trained(tmp_path / "none.ckpt")


def without(key):
    return lambda content: content.pop(key)


def setting(*keys, value):
    """Overwrites a nested value."""

    def change(content):
        for key in keys[:-1]:
            content = content[key]
        content[keys[-1]] = value

    return change


OTHERS = {
    "another program's": (without("most"), "found one of another program; choose another"),
    "a description of another kind": (setting("most", value=7), "found one of another program"),
    "another format": (setting("most", "format", value=FORMAT + 1), f"format {FORMAT}, found {FORMAT + 1}; load it"),
    "no run": (without("most_run"), "a whole checkpoint, found none of most_run"),
    "no format": (setting("most", "format", value=None), f"format {FORMAT}, found None"),
    "unknown taxonomy": (setting("most", "taxonomy", "name", value="mars"), "found 'mars'.*train it again"),
    "other classes": (
        setting("most", "taxonomy", "class_names", value=["void", "cat"]),
        "taxonomy semantickitti: expected its classes",
    ),
    "other things": (
        setting("most", "taxonomy", "things", value=[1, 2]),
        "taxonomy semantickitti: expected its classes",
    ),
    "later component": (setting("most", "parts", "membership", "component", value="learnt"), "found learnt.*version"),
    "later setting": (setting("most", "parts", "grid", "settings", "spin", value=1), "grid.*spin.*version that wrote"),
    "out of range": (setting("most", "parts", "grid", "settings", "voxel_size", value=[0.0] * 3), "voxel_size"),
    "no size": (setting("most", "parts", "grid", "settings", "voxel_size", value=[math.nan] * 3), "voxel_size"),
    "no end": (setting("most", "parts", "grid", "settings", "upper", value=[math.inf] * 3), "grid.upper"),
    "a taxonomy elsewhere": (
        setting("most", "taxonomy", "name", value="../taxonomies/nuscenes"),
        "taxonomy: expected one",
    ),
    "fewer than no sweeps": (
        setting("most", "sweeps", value=-1),
        "sweeps: expected a number from 0 to 10000, found -1",
    ),
    "sweeps in words": (setting("most", "sweeps", value="x"), "sweeps: expected a number from 0 to 10000, found 'x'"),
    "sweeps without end": (setting("most", "sweeps", value=10**30), "sweeps: expected a number from 0 to 10000"),
    "a part less": (lambda content: content["most"]["parts"].pop("encoder"), "encoder.*train it again"),
    "no weights": (without("state_dict"), "a whole checkpoint, found none of state_dict"),
    "a weight less": (lambda content: content["state_dict"].popitem() and content["state_dict"].popitem(), "Missing"),
    "wider": (setting("most", "parts", "encoder", "settings", "widths", value=[8, 6]), "size mismatch.*train it"),
}


@pytest.mark.parametrize("other", OTHERS)
def test_checkpoints_of_other_models_are_refused_with_a_remedy(tmp_path, other):
    change, message = OTHERS[other]
    content = checkpoint(tiny_predictor())
    change(content)
    with pytest.raises(DataError, match=rf"(?s)some\.ckpt: expected.*{message}"):
        load_trained(save(tmp_path, content))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_weights_that_are_not_finite_are_refused(tmp_path, value):
    content = checkpoint(tiny_predictor())
    name, weights = next(item for item in content["state_dict"].items() if item[1].is_floating_point())
    content["state_dict"][name] = weights.fill_(value)
    with pytest.raises(DataError, match=rf"some\.ckpt: {name}: expected finite weights, found others"):
        load_trained(save(tmp_path, content))


def test_a_list_is_no_checkpoint(tmp_path):
    with pytest.raises(DataError, match="another program"):
        load_trained(save(tmp_path, [1, 2]))


def test_a_dataset_that_the_model_does_not_know_is_refused():
    check_taxonomy(Taxonomy.load("nuscenes"), Taxonomy.load("nuscenes"))
    with pytest.raises(ConfigError, match="dataset: expected one of nuscenes, which the model knows, found one of sem"):
        check_taxonomy(Taxonomy.load("nuscenes"), Taxonomy.load("semantickitti"))


def test_a_folder_is_no_checkpoint_and_the_file_to_name_is_said(tmp_path):
    with pytest.raises(
        DataError, match=r"expected a checkpoint, found a folder; name a file, such as checkpoints/STAGE"
    ):
        load_trained(tmp_path)
    (tmp_path / "checkpoints").mkdir()
    for name in ("membership-last", "detection-best"):
        (tmp_path / "checkpoints" / f"{name}.ckpt").touch()
    for folder in (tmp_path, tmp_path / "checkpoints"):
        with pytest.raises(DataError, match=r"found a folder; name a file, such as .*/membership-last\.ckpt"):
            load_trained(folder)

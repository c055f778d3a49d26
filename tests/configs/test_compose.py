"""Every configuration file composes, and turns into components whose ranges are checked."""

import importlib

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from most.checks import check_dropped
from most.config import COMPONENTS, conf_dir, typed

ROOTS = sorted(path.stem for path in conf_dir().glob("*.yaml"))
OPTIONS = sorted((path.parent.name, path.stem) for path in conf_dir().glob("*/*.yaml"))
OF_OTHER_ROOTS = {"simulation": "simulate", "tracker": "track"}
REQUIRED = {
    "compare": ["reports={a: a.json}"],
    "draw": ["predictions=a", "sequence='08'"],
    "predict": ["checkpoint=a.ckpt", "out=b"],
    "evaluate": ["predictions=a"],
    "submit": ["predictions=a"],
    "view": ["predictions=a", "sequence='08'"],
    "track": ["predictions=a", "out=b"],
    "velocity": ["velocity=a", "nearest=b"],
    "report": ["runs=a"],
}


@pytest.fixture(autouse=True, scope="module")
def configurations():
    for command in ROOTS:
        importlib.import_module(f"most.{command}")  # registers its schemas
    with initialize_config_dir(str(conf_dir()), version_base=None):
        yield


@pytest.mark.parametrize("root", ROOTS)
def test_every_command_composes(root):
    typed(compose(root, REQUIRED.get(root, [])))


@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_every_option_composes(group, option):
    sign = "+" if group == "experiment" else ""
    root = OF_OTHER_ROOTS.get(group, "train")
    typed(compose(root, [*REQUIRED.get(root, []), f"{sign}{group}={option}"]))


@pytest.mark.parametrize("path", sorted(conf_dir().rglob("*.yaml")), ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_file_opens_with_the_command_that_uses_it(path):
    comments = [line for line in path.read_text().splitlines()[:2] if line.startswith("# python -m most.")]
    assert comments


def test_every_option_names_a_schema():
    with_schema = [path for path in conf_dir().glob("*/*.yaml") if path.parent.name != "experiment"]
    assert all("_schema" in path.read_text() for path in with_schema)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("stage.detection.max_lr=-1", "stage.detection.max_lr"),
        ("grid.voxel_size=[0,1,1]", "grid.voxel_size"),
        ("trainer.precision=foo", "trainer.precision"),
        ("seed=-1", "seed"),
        ("stage.detection.max_lr=nan", "stage.detection.max_lr"),
        ("stage.detection.losses.heatmap=-1", "losses.heatmap"),
        ("backbone.widths=[1,2]", "backbone.widths"),
    ],
)
def test_values_out_of_range_are_refused(override, message):
    with pytest.raises(Exception, match=message):
        typed(compose("train", [override]))


@pytest.mark.parametrize("override", ["stage.learning_rate=1", "grid.voxel_size=small", "dataset.batch_size=two"])
def test_unknown_keys_and_wrong_types_do_not_compose(override):
    with pytest.raises(Exception, match=override.split("=")[0].split(".")[-1]):
        compose("train", [override])


@pytest.mark.parametrize("experiment", ["sim_ablation", "sim_ablation_small", "nuscenes_max"])
@pytest.mark.parametrize("extent", sorted(path.stem for path in (conf_dir() / "extent").glob("*.yaml")))
def test_an_extent_strategy_is_one_word_away(experiment, extent):
    config = typed(compose("train", [f"+experiment={experiment}", f"extent={extent}"]))
    assert isinstance(config.extent, COMPONENTS["extent"][extent])
    check_dropped(config)


def test_composed_configurations_are_plain_enough_to_log():
    assert OmegaConf.to_container(compose("train"), resolve=True)["stage"]["detection"]["epochs"] == 20

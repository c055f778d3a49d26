"""The configuration's schema: every component is its own, and this module puts them together.

``Config`` is the root. A YAML file under ``conf/<group>/`` names its schema in its defaults (``<name>_schema``), so an
unknown key or a wrong type is refused when the configuration is composed; ranges are checked by ``typed``, which turns
the composed configuration into the components themselves.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from most.backbones import AsymmetricUNetSettings, AsymmetricUNetSmallSettings, ResidualUNetSettings
from most.datasets.augment import Augment
from most.datasets.nuscenes import NuScenesSettings
from most.datasets.semantickitti import SemanticKITTISettings
from most.encoder import PointEncoder
from most.errors import ConfigError
from most.heads import CentreHead, OffsetHead, OrientedCentreHead, SemanticHead
from most.inference import Inference
from most.logs import LoggerSettings
from most.membership import Clustering, MeanShift, Nearest, PointSegMLPSettings
from most.modal.amodal import Amodal
from most.modal.class_mean import ClassMean
from most.modal.extent import DropSmall, ShrinkWrap, TrackMax
from most.stages.settings import StageSettings
from most.stages.trainer import TrainerSettings
from most.tracking import TrackerSettings
from most.voxels import Grid


@dataclass
class Heads:
    """What reads the backbone's features: modal centres are detected."""

    centre: CentreHead = field(default_factory=CentreHead)
    semantic: SemanticHead = field(default_factory=SemanticHead)


@dataclass
class OffsetHeads:
    """What reads the backbone's features: offsets to modal centres are regressed (DS-Net, Table I)."""

    centre: OffsetHead = field(default_factory=OffsetHead)
    semantic: SemanticHead = field(default_factory=SemanticHead)


COMPONENTS: dict[str, dict[str, type]] = {
    "dataset": {"semantickitti": SemanticKITTISettings, "nuscenes": NuScenesSettings},
    "augment": {"augment": Augment},
    "extent": {
        "shrink_wrap": ShrinkWrap,
        "drop_small": DropSmall,
        "class_mean": ClassMean,
        "track_max": TrackMax,
        "amodal": Amodal,
    },
    "grid": {"grid": Grid},
    "encoder": {"encoder": PointEncoder},
    "backbone": {
        "asymmetric_unet": AsymmetricUNetSettings,
        "asymmetric_unet_small": AsymmetricUNetSmallSettings,
        "residual_unet": ResidualUNetSettings,
    },
    "heads": {"modal_centres": Heads, "offset_regression": OffsetHeads},
    "membership": {
        "nearest": Nearest,
        "point_seg_mlp": PointSegMLPSettings,
        "clustering": Clustering,
        "mean_shift": MeanShift,
    },
    "stage": {"stage": StageSettings},
    "trainer": {"trainer": TrainerSettings},
    "logger": {"logger": LoggerSettings},
    "centre_head": {
        "centre_head": CentreHead,
        "oriented_centre_head": OrientedCentreHead,
        "offset_head": OffsetHead,
    },
    "semantic_head": {"semantic_head": SemanticHead},
    "inference": {"inference": Inference},
    "tracker": {"tracker": TrackerSettings},
}


@dataclass
class Paths:
    """Where things are written."""

    output: str = "outputs"  # run folders


@dataclass
class Config:
    """Everything ``most.train`` is told; the fields with ``Any`` are groups whose member chooses the class."""

    name: str = "most"
    seed: int = 1
    resume: str | None = None  # a checkpoint to go on from
    stage1: str | None = None  # the trained stage 1 for stage=membership
    weights: str | None = None  # a checkpoint whose network stage 1 begins with, of other scans or simulated ones
    dataset: Any = None
    augment: Any = None
    extent: Any = None
    grid: Any = None
    encoder: Any = None
    backbone: Any = None
    heads: Any = None
    membership: Any = None
    inference: Inference = field(default_factory=Inference)
    stage: Any = None
    trainer: Any = None
    logger: Any = None
    paths: Paths = field(default_factory=Paths)

    def __post_init__(self) -> None:
        if not 0 <= self.seed < 2**32:
            raise ConfigError(f"seed: expected a number in [0, 2^32), found {self.seed}")


def conf_dir() -> Path:
    """The folder of YAML files: the one packed into the wheel, else the checkout's."""
    packed = Path(__file__).parent / "conf"
    return packed if packed.is_dir() else Path(__file__).parents[2] / "conf"


def store_root(command: str, schema: type) -> None:
    """Tell Hydra the root schema of a command; its YAML names it ``<command>_schema``."""
    ConfigStore.instance().store(name=f"{command}_schema", node=schema)


def register() -> None:
    """Tell Hydra the schemas of all components; they get their names in ``defaults`` from here."""
    store = ConfigStore.instance()
    store_root("train", Config)
    for group, members in COMPONENTS.items():
        for name, schema in members.items():
            store.store(group=group, name=f"{name}_schema", node=schema)


def typed(config: DictConfig | ListConfig, name: str = "") -> Any:
    """Turn a composed configuration into its components; a value out of range, or none, is a ConfigError.

    ``name`` is the group that it is the settings of, for messages.
    """
    if missing := sorted(OmegaConf.missing_keys(config)):
        raise ConfigError(f"{missing[0]}: expected a value, found none; say {missing[0]}=...")
    try:
        _check_finite(OmegaConf.to_container(config, resolve=True), name)
        return OmegaConf.to_object(config)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{error.full_key or 'configuration'}: {error}") from error


def _check_finite(value: Any, key: str) -> None:
    """Refuse numbers that are none or infinite, however deep: no setting means anything by them."""
    if isinstance(value, list):
        value = dict(enumerate(value))
    if isinstance(value, dict):
        for name, part in value.items():
            _check_finite(part, f"{key}.{name}".lstrip("."))
    elif isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f"{key}: expected a finite number, found {value}")


def to_plain(group: str, component: Any) -> dict[str, Any]:
    """Describe a component by names, numbers, lists and dicts alone, as checkpoints keep it."""
    name = next(name for name, schema in COMPONENTS[group].items() if schema is type(component))
    return {"component": name, "settings": asdict(component)}


def from_plain(group: str, plain: Mapping[str, Any]) -> Any:
    """Make the component that ``to_plain`` described."""
    schema = COMPONENTS[group].get(plain["component"])
    if schema is None:
        known = ", ".join(COMPONENTS[group])
        raise ConfigError(f"{group}: expected one of {known}, found {plain['component']} (of a later version?)")
    return from_settings(schema, group, plain["settings"])


def from_settings(schema: type, name: str, settings: Mapping[str, Any]) -> Any:
    """Make settings of the plain types they were kept in; a field that was added since has its default."""
    try:
        merged = OmegaConf.merge(OmegaConf.structured(schema), settings)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{name}.{error.full_key}: {error}") from error
    return typed(merged, name)

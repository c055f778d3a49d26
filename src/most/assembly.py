"""Putting the components together, and the checkpoint that takes them apart again."""

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import torch
from torch import nn

from most.backbones.contract import BackboneSettings
from most.config import Config, from_plain, to_plain
from most.datasets.reader import Frame
from most.datasets.taxonomy import Taxonomy
from most.errors import ConfigError, DataError, named
from most.heads import CentreHead, OrientedCentreHead, SemanticHead
from most.inference import Predictor
from most.membership import Channels, MeanShift, Membership, Nearest, PointSegMLPSettings
from most.modal.amodal import Amodal
from most.modal.extent import DropSmall, TrackMax
from most.modal.heatmap import HeatmapTargets
from most.modal.instances import Extent
from most.network import Network, Trunk
from most.voxels import Grid

FORMAT = 3
MOST_SWEEPS = 10_000  # previous sweeps in a window; whoever says more is not to be believed
KEYS = ("most_run", "state_dict")  # beside "most", which describes the model: what it was trained with, its weights
STAGE1_RUN = "most_stage1"  # in a checkpoint of stage 2: the ``most_run`` of the stage 1 that it stands on
GROUPS = ("grid", "encoder", "backbone", "centre_head", "semantic_head", "membership", "inference")


def build_network(parts: dict[str, Any], taxonomy: Taxonomy) -> Network:
    """Make the stage-1 network of the components named in ``GROUPS``."""
    grid: Grid = parts["grid"]
    encoder = parts["encoder"].build(grid)
    settings: BackboneSettings = parts["backbone"]
    backbone = settings.build(encoder.voxel_channels, grid.shape)
    centre_head, semantic_head = parts["centre_head"], cast(SemanticHead, parts["semantic_head"])
    on_voxels = centre_head.gives == "offsets"
    return Network(
        grid,
        encoder,
        backbone,
        centre_head.build(backbone.voxel_channels if on_voxels else backbone.bev_channels, len(taxonomy.things)),
        semantic_head.build(
            taxonomy.num_classes - 1, backbone.voxel_channels, encoder.point_channels, backbone.bev_channels
        ),
        build_trunk(parts, decoder=on_voxels) if settings.separate else None,
    )


def build_trunk(parts: dict[str, Any], decoder: bool) -> Trunk:
    """Make another point encoder and backbone of the same kind, where detection shares none."""
    encoder = parts["encoder"].build(parts["grid"])
    return Trunk(encoder, parts["backbone"].build(encoder.voxel_channels, parts["grid"].shape, decoder))


def build_membership(parts: dict[str, Any], network: Network, taxonomy: Taxonomy) -> Membership:
    """Make the membership that goes with a network; one that needs what the network does not give is a ConfigError."""
    check_membership(parts)
    channels = Channels(
        classes=taxonomy.num_classes - 1,
        things=list(taxonomy.things),
        point=network.encoder.point_channels,
        bev=network.backbone.bev_channels,
        boxes=[taxonomy.boxes[thing] for thing in taxonomy.things],
    )
    made: Membership = parts["membership"].build(channels)
    return made


def check_membership(parts: dict[str, Any]) -> None:
    """Refuse a membership of detected centres where offsets are regressed, and the other way round."""
    needs, gives = parts["membership"].needs, parts["centre_head"].gives
    if needs not in (None, gives):
        heads = {"centres": "modal_centres", "offsets": "offset_regression"}
        raise ConfigError(
            f"membership: expected one that needs no {needs}, as the model's heads are {heads[gives]}, found "
            f"{to_plain('membership', parts['membership'])['component']}; choose another, or heads={heads[needs]}"
        )


def build_predictor(network: Network, parts: dict[str, Any], taxonomy: Taxonomy) -> Predictor:
    """Join a network with what comes after it."""
    membership = build_membership(parts, network, taxonomy)
    return Predictor(network, list(taxonomy.things), taxonomy.stuff[0], membership, parts["inference"])


def model_parts(config: Config) -> dict[str, Any]:
    """Pick what a trained model consists of out of a training's configuration; amodal boxes have a yaw."""
    centre = config.heads.centre
    turned = isinstance(config.extent, Amodal) and isinstance(centre, CentreHead)
    return {
        "grid": config.grid,
        "encoder": config.encoder,
        "backbone": config.backbone,
        "centre_head": OrientedCentreHead(**vars(centre)) if turned else centre,
        "semantic_head": config.heads.semantic,
        "membership": config.membership,
        "inference": config.inference,
    }


def stage1_parts(config: Config) -> dict[str, Any]:
    """Pick what stage 1 consists of; the nearest centre, or mean shift, stands in for what stage 2 is to train."""
    parts = model_parts(config)
    stand_in = Nearest() if parts["centre_head"].gives == "centres" else MeanShift()
    return parts | ({"membership": stand_in} if isinstance(parts["membership"], PointSegMLPSettings) else {})


def describe(parts: dict[str, Any], taxonomy: Taxonomy, sweeps: int) -> dict[str, Any]:
    """Return what a checkpoint says of its model, in plain types: it loads without running anything."""
    return {
        "format": FORMAT,
        "taxonomy": describe_taxonomy(taxonomy),
        "sweeps": sweeps,
        "parts": {group: to_plain(group, part) for group, part in parts.items()},
    }


def describe_run(config: Config, stage: str, frames: Sequence[Frame]) -> dict[str, Any]:
    """Return what a stage's weights depend on besides its model, in plain types: a run goes on only with the same.

    ``frames`` are those to train on.
    """
    return {
        "stage": stage,
        "training": asdict(training_of(config, stage)),
        "augment": asdict(config.augment),
        "extent": to_plain("extent", config.extent),
        "scans": dict(Counter(frame.sequence for frame in frames)),
        "seed": config.seed,
        "batch_size": config.dataset.batch_size,
        "processes": config.trainer.processes(),
        "weights": config.weights,
    }


def training_of(config: Config, stage: str) -> Any:
    """Return a stage's settings, the heat maps' with what the extent strategy drops."""
    settings = getattr(config.stage, stage)
    if stage != "detection" or not isinstance(config.extent, DropSmall):
        return settings
    return replace(settings, targets=replace(settings.targets, min_points=config.extent.min_points))


def describe_taxonomy(taxonomy: Taxonomy) -> dict[str, Any]:
    """Return what the columns of logits and the channels of the heat map stand for."""
    return {"name": taxonomy.name, "class_names": list(taxonomy.class_names), "things": list(taxonomy.things)}


def check_taxonomy(trained: Taxonomy, read: Taxonomy) -> None:
    """Refuse a dataset that a model was not trained for: its classes would be written as the other's."""
    if describe_taxonomy(trained) != describe_taxonomy(read):
        raise ConfigError(f"dataset: expected one of {trained.name}, which the model knows, found one of {read.name}")


@dataclass
class Trained:
    """A trained model and all that prediction needs beside it."""

    predictor: Predictor
    taxonomy: Taxonomy
    sweeps: int  # previous sweeps in its window
    parts: dict[str, Any] = field(default_factory=dict)  # the components it is made of, as named in ``GROUPS``
    stage1: dict[str, Any] = field(default_factory=dict)  # what ``describe_run`` said of stage 1; empty: not known
    targets: HeatmapTargets | None = None  # how the heat maps that it learned from were drawn; None: not known
    extent: Extent | None = None  # how large instances were for it; None: not known

    def likely_targets(self) -> HeatmapTargets:
        """Return how its heat maps were drawn; the default, with a warning, where the checkpoint does not say."""
        if self.targets is None:
            warnings.warn("the checkpoint does not say how heat maps were drawn: the default is taken", stacklevel=2)
        return self.targets or HeatmapTargets()

    def likely_extent(self) -> Extent:
        """Return how large instances were for it; track-maximum, with a warning, where the checkpoint does not say."""
        if self.extent is None:
            warnings.warn("the checkpoint does not say how large instances were: track_max is taken", stacklevel=2)
        return self.extent or TrackMax()


def load_trained(path: Path) -> Trained:
    """Read a checkpoint; a file that is none, of another version or of another taxonomy, is a DataError."""
    checkpoint = read_checkpoint(path)
    try:
        with named(path):
            return _assemble(checkpoint["most"], checkpoint["state_dict"], stage1_run(checkpoint))
    except (ConfigError, LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RuntimeError) as error:
        raise DataError(
            f"{path}: expected a model that this version of most can make, found another ({error}); "
            "load it with the version that wrote it, or train it again"
        ) from error


def stage1_run(checkpoint: dict[str, Any]) -> dict[str, Any]:
    """Return what stage 1 of a checkpoint was trained with; nothing where one of stage 2 does not say."""
    run: dict[str, Any] = checkpoint["most_run"]
    return run if run.get("stage") == "detection" else checkpoint.get(STAGE1_RUN, {})


def _assemble(description: dict[str, Any], state: dict[str, Any], stage1: dict[str, Any]) -> Trained:
    """Make the model that ``describe`` described, and load its weights."""
    taxonomy = Taxonomy.load(description["taxonomy"]["name"])
    if describe_taxonomy(taxonomy) != description["taxonomy"]:
        raise ConfigError(f"taxonomy {taxonomy.name}: expected its classes and things, found others")
    if type(sweeps := description["sweeps"]) is not int or not 0 <= sweeps <= MOST_SWEEPS:
        raise ConfigError(f"sweeps: expected a number from 0 to {MOST_SWEEPS}, found {sweeps!r:.40}")
    parts = {group: from_plain(group, description["parts"][group]) for group in GROUPS}
    predictor = build_predictor(build_network(parts, taxonomy), parts, taxonomy)
    for name, module in predictor.modules().items():
        load_weights(module, name, state)
        module.eval()
    drawn, sized = stage1.get("training", {}).get("targets"), stage1.get("extent")
    targets = None if drawn is None else HeatmapTargets(**drawn)
    extent = None if sized is None else from_plain("extent", sized)
    return Trained(predictor, taxonomy, sweeps, parts, stage1, targets, extent)


def load_weights(module: nn.Module, name: str, state: dict[str, Any]) -> None:
    """Give a part of a model the weights that a checkpoint's ``state_dict`` has under its name, if they are finite."""
    prefix = f"{name}."
    own = {key[len(prefix) :]: value for key, value in state.items() if key.startswith(prefix)}
    if bad := [key for key, value in own.items() if not bool(value.isfinite().all())]:
        raise DataError(
            f"{prefix}{bad[0]}: expected finite weights, found others, here and in {len(bad) - 1} more; the training "
            "diverged, or the file is damaged: take an earlier checkpoint, or train again"
        )
    module.load_state_dict(own)


def exchange_membership(trained: Trained, membership: Any) -> Trained:
    """Return the model with another membership; one with weights of its own would not be trained: a ConfigError."""
    if isinstance(membership, PointSegMLPSettings):
        raise ConfigError("membership: expected one without training, such as nearest, found one that stage 2 trains")
    predictor = trained.predictor
    parts = trained.parts | {"membership": membership}
    made = build_membership(parts, predictor.network, trained.taxonomy)
    return replace(trained, predictor=replace(predictor, membership=made), parts=parts)


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint of ours without running any code in it."""
    if path.is_dir():
        kept = sorted([*path.glob("*.ckpt"), *path.glob("checkpoints/*.ckpt")])
        example = kept[-1] if kept else "checkpoints/STAGE-last.ckpt of a run"
        raise DataError(f"{path}: expected a checkpoint, found a folder; name a file, such as {example}")
    if not path.is_file():
        raise DataError(f"{path}: expected a checkpoint, found no file; train a model first: python -m most.train")
    try:
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # the unpickler has no error of its own: it stumbles over foreign bytes in many ways
        raise DataError(
            f"{path}: expected a checkpoint, found something else or a truncated one; copy it again ({error})"
        ) from error
    if not isinstance(checkpoint, dict) or not isinstance(checkpoint.get("most"), dict):
        raise DataError(f"{path}: expected a checkpoint of most.train, found one of another program; choose another")
    if (found := checkpoint["most"].get("format")) != FORMAT:
        raise DataError(
            f"{path}: expected checkpoint format {FORMAT}, found {found}; load it with the version of most that "
            "wrote it, or train it again"
        )
    if missing := [key for key in KEYS if not isinstance(checkpoint.get(key), dict)]:
        raise DataError(f"{path}: expected a whole checkpoint, found none of {', '.join(missing)}; copy it again")
    return checkpoint

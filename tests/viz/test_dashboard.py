"""The dashboard's layout, and the workspace that is made of it."""

import json
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import pytest
import wandb

from most import dashboard as command
from most.dashboard import DashboardConfig, dashboard
from most.errors import ConfigError
from most.losses import LossWeights
from most.viz import dashboard as panels
from most.viz.dashboard import describe, layout, workspace


def test_sections_are_those_that_there_is_something_to_show_of():
    names = [section.name for section in layout(["car"], 2)]
    assert names == ["Losses", "Panoptic quality", "By class", "Membership", "Bird's-eye view", "Throughput"]
    assert "Bird's-eye view" not in [section.name for section in layout(["car"], 0)]


def test_classes_have_curves_and_pictures_panels_in_both_stages():
    panels = {panel.title: panel for section in layout(["car", "person"], 2) for panel in section.panels}
    assert panels["class_pq"].keys == ["val/class_pq/car", "val/class_pq/person"]
    assert panels["membership/bev"].keys == ["membership/val/bev_1", "membership/val/bev_2"]
    assert panels["pq"].keys == ["val/pq", "membership/val/nearest_pq", "membership/val/pq"]


def test_every_loss_that_a_stage_can_log_has_a_panel():
    losses = {part.name for part in fields(LossWeights)} - {"class_balance"}
    keys = {key for panel in layout([], 0)[0].panels for key in panel.keys}
    assert keys == {"train/loss", "membership/train/loss", *(f"train/loss_{name}" for name in losses)}


def test_the_workspace_shows_every_key_and_groups_by_extent_and_membership():
    pytest.importorskip("wandb_workspaces")
    sections = layout(["car"], 1)
    made = workspace(sections, "team", "most", "MOST")
    published = json.dumps(made._to_model().model_dump(mode="json"))
    said = describe(sections)
    keys = [key for section in said["sections"] for panel in section["panels"] for key in panel["keys"]]
    assert [key for key in keys if key not in published] == []
    assert [section.name for section in made.sections] == [section["name"] for section in said["sections"]]
    assert [key.name for key in made.runset_settings.groupby] == said["grouped_by"]


def test_publishing_needs_a_key_an_entity_and_the_package(tmp_path, no_account):
    with pytest.raises(ConfigError, match=r"publish: expected the user or team .* found none; say entity=NAME"):
        DashboardConfig(publish=True)
    config = DashboardConfig(str(tmp_path / "dashboard.json"), publish=True, entity="team")
    with pytest.raises(ConfigError, match="publish: expected a key for W&B online, found none; run wandb login"):
        dashboard(config)
    assert not Path(config.out).exists()
    no_account.setattr(panels, "importlib", SimpleNamespace(import_module=lambda _: __import__("no_such_package")))
    no_account.setenv("WANDB_API_KEY", "0" * 40)
    with pytest.raises(ConfigError, match=r"expected the package wandb-workspaces, found none; pip install"):
        dashboard(config)


def test_what_wandb_refuses_of_a_workspace_is_said(tmp_path, no_account):
    class Refused:
        def save(self):
            raise wandb.errors.CommError("no such team")

    no_account.setenv("WANDB_API_KEY", "0" * 40)
    no_account.setattr(command, "workspace", lambda *_: Refused())
    config = DashboardConfig(str(tmp_path / "dashboard.json"), publish=True, entity="team")
    with pytest.raises(ConfigError, match=r"publish: .* for team/most, found CommError: no such team; see that"):
        dashboard(config)
    assert Path(config.out).is_file()

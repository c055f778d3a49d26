"""What comes after the network loses nothing of the truth of real sequences."""

import os
from pathlib import Path

import pytest

from most.datasets.instances import InstanceTables
from most.datasets.semantickitti import SemanticKITTI, Splits
from most.inference import Inference
from most.ladder import Ladder, NoModel, climb
from most.modal.extent import TrackMax
from most.tracking import TrackerSettings
from most.voxels import Grid

REAL = os.environ.get("MOST_REAL_DATA")
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not REAL, reason="MOST_REAL_DATA is unset: it names the folder of the unpacked real scans"),
]


@pytest.mark.parametrize(("sequence", "official", "tubes"), [("04", 0.864, 0.972), ("07", 0.953, 1.0)])
def test_everything_substituted_reaches_the_ceiling(
    tmp_path: Path, sequence: str, official: float, tubes: float
) -> None:
    reader = SemanticKITTI(Path(str(REAL)) / "semantickitti", Splits(val=[sequence]))
    look = NoModel(Grid(), Inference(), reader.taxonomy.num_classes)
    ladder = Ladder(reader.taxonomy, InstanceTables(reader, TrackMax(), tmp_path), look, TrackerSettings())
    climb(ladder, reader, "val", previous=0, ahead=False)
    rows = ladder.report()
    ceilings = {name: row["lstq"] for name, row in rows.items() if "ceiling" in name}
    assert ceilings["ceiling: the truth"]["lstq"] == pytest.approx(official, abs=1e-3)
    assert ceilings["ceiling: its tubes"]["lstq"] == pytest.approx(tubes, abs=1e-3)
    assert ceilings["ceiling: its tubes"]["lstq_repaired"] == pytest.approx(1)
    top = rows["everything"]
    assert top["panoptic"]["pq"] >= 0.999 * rows["ceiling: the truth"]["panoptic"]["pq"]
    for key in ("lstq", "lstq_repaired"):
        assert top["lstq"][key] >= 0.999 * ceilings["ceiling: its instances"][key] >= 0.999 * official

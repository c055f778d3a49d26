"""Run by the devkit's Python: what it says of a package: ROOT VERSION SPLIT FOLDER SCENE OUT.

FOLDER holds the unpacked package, OUT gets the figures of its evaluation. The panoptic task has no validator of its own
in the devkit: that of the lidarseg task, whose results are the classes alone, is run on the package's classes.
"""

import json
import sys
from pathlib import Path

import numpy as np
from nuscenes import NuScenes
from nuscenes.eval.lidarseg import utils as lidarseg_utils
from nuscenes.eval.lidarseg.validate_submission import validate_submission
from nuscenes.eval.panoptic import evaluate
from nuscenes.utils.data_io import load_bin_file, panoptic_to_lidarseg


def validate(nusc, folder, split):
    """Raise AssertionError for what the server's first look would refuse."""
    results = folder.parent / "classes"
    submission = json.loads((folder / split / "submission.json").read_text())
    assert submission["meta"].pop("task") in ("segmentation", "tracking")  # the lidarseg task has no other
    (results / split).mkdir(parents=True)
    (results / split / "submission.json").write_text(json.dumps(submission))
    (results / "lidarseg" / split).mkdir(parents=True)
    for path in (folder / "panoptic" / split).iterdir():
        classes = panoptic_to_lidarseg(load_bin_file(str(path), type="panoptic"))
        classes.tofile(results / "lidarseg" / split / path.name.replace("panoptic.npz", "lidarseg.bin"))
        assert load_bin_file(str(path), type="panoptic").dtype == np.uint16
    validate_submission(nusc, str(results), split)


if __name__ == "__main__":
    root, version, split, folder, scene, out = sys.argv[1:]
    for module in (lidarseg_utils, evaluate):  # the official splits, of which the tree has one scene
        module.create_splits_scenes = lambda verbose=False: {split: [scene]}
    nusc = NuScenes(version, root, verbose=False)
    validate(nusc, Path(folder), split)
    evaluate.NuScenesPanopticEval(nusc, folder, split, "tracking", 15, out).evaluate()

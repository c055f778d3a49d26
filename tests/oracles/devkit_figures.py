"""Run by the devkit's Python: figures of its evaluators, of labels in an archive, as JSON: IN.npz OUT.json.

The archive holds for case i ``pred_i truth_i`` (labels as on disk), ``classes_i`` (of the truth), ``scan_i``
(the number of each point's scan, ascending) and ``scene_i`` (the number of each scan's scene), and ``min_points``.
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np
from nuscenes.eval.panoptic.panoptic_seg_evaluator import PanopticEval
from nuscenes.eval.panoptic.panoptic_track_evaluator import PanopticTrackingEval

CLASSES, FIRST_STUFF = 17, 11


def figures(pred, truth, classes, scan, scene, min_points):
    segmentation = PanopticEval(CLASSES, ignore=[0], min_points=min_points)
    tracking = PanopticTrackingEval(CLASSES, FIRST_STUFF, ignore=[0], min_points=min_points)
    lists, before = [], None
    for number, of_scene in enumerate(scene.tolist()):
        points = scan == number
        arrays = [pred[points] // 1000, pred[points], classes[points], truth[points]]
        segmentation.addBatch(*arrays)
        # As evaluate.py has it: the evaluator changes these lists, and finds what it left there in the next scan.
        last = [pair[1] for pair in lists] if of_scene == before else [None] * len(arrays)
        lists, before = [list(pair) for pair in zip(last, arrays, strict=True)], of_scene
        tracking.add_batch(str(of_scene), *lists)
    pq, sq, rq, *_ = segmentation.getPQ()
    miou, _ = segmentation.getSemIoU()
    lstq, s_assoc = tracking.get_lstq()
    (ptq, _, sptq, _), (motsa, smotsa, motsp) = tracking.get_ptq(), tracking.get_motsa()
    try:
        pat, track_pq, tq = tracking.get_pat()
    except ZeroDivisionError:  # without a track
        pat, track_pq, tq = float("nan"), tracking.getPQ()[0], float("nan")
    found = {
        "pq": pq, "sq": sq, "rq": rq, "miou": miou, "lstq": lstq, "s_assoc": s_assoc, "ptq": ptq, "sptq": sptq,
        "motsa": motsa, "smotsa": smotsa, "motsp": motsp, "pat": pat, "tq": tq, "track_pq": track_pq,
    }  # fmt: skip
    return {name: float(value) for name, value in found.items()}


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    with np.load(sys.argv[1]) as archive:
        names = ("pred", "truth", "classes", "scan", "scene")
        cases = [
            figures(*(archive[f"{name}_{case}"] for name in names), int(archive["min_points"]))
            for case in range(int(archive["cases"]))
        ]
    Path(sys.argv[2]).write_text(json.dumps(cases))

"""The benchmarks' panoptic evaluation the plain way, float64: one pass a class, segments found anew in each.

Written from the definition, to be a reference for figures and for speed; use nothing of ``most`` here.
"""

from dataclasses import dataclass, field

import numpy as np

EPS = 1e-15


@dataclass
class OfficialPanoptic:
    """Accumulates scans; void is class 0; keys are whole raw labels of at most 32 bits."""

    num_classes: int
    min_points: int
    confusion: np.ndarray = field(init=False)
    iou: np.ndarray = field(init=False)
    tp: np.ndarray = field(init=False)
    fp: np.ndarray = field(init=False)
    fn: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.confusion = np.zeros((self.num_classes, self.num_classes), dtype=np.int64)
        self.iou = np.zeros(self.num_classes)
        self.tp, self.fp, self.fn = (np.zeros(self.num_classes, dtype=np.int64) for _ in range(3))

    def add(self, pred_sem: np.ndarray, pred_key: np.ndarray, truth_sem: np.ndarray, truth_key: np.ndarray) -> None:
        np.add.at(self.confusion, (pred_sem, truth_sem), 1)
        known = truth_sem != 0
        pred_sem, pred_key = pred_sem[known], pred_key[known].astype(np.uint64) + np.uint64(1)
        truth_sem, truth_key = truth_sem[known], truth_key[known].astype(np.uint64) + np.uint64(1)
        for label in range(1, self.num_classes):
            self._add_class(label, pred_key * (pred_sem == label), truth_key * (truth_sem == label))

    def _add_class(self, label: int, pred: np.ndarray, truth: np.ndarray) -> None:
        """Segments of one class; 0 is 'another class', which the shift of the keys by one keeps free."""
        pred_area = dict(zip(*_counts(pred[pred > 0]), strict=True))
        truth_area = dict(zip(*_counts(truth[truth > 0]), strict=True))
        both = (pred > 0) & (truth > 0)
        overlaps, sizes = _counts((truth[both] << np.uint64(32)) + pred[both])
        matched_pred, matched_truth = set(), set()
        for overlap, size in zip(overlaps, sizes, strict=True):
            one, other = overlap >> np.uint64(32), overlap & np.uint64(0xFFFFFFFF)
            iou = float(size) / float(truth_area[one] + pred_area[other] - size)
            if iou > 0.5:
                self.tp[label] += 1
                self.iou[label] += iou
                matched_truth.add(one)
                matched_pred.add(other)
        self.fn[label] += sum(area >= self.min_points for key, area in truth_area.items() if key not in matched_truth)
        self.fp[label] += sum(area >= self.min_points for key, area in pred_area.items() if key not in matched_pred)

    def class_figures(self) -> dict[str, np.ndarray]:
        """Figures of every class, void included as zeros."""
        sq = self.iou / np.maximum(self.tp, EPS)
        rq = self.tp / np.maximum(self.tp + self.fp / 2 + self.fn / 2, EPS)
        confusion = self.confusion.astype(np.float64)
        confusion[:, 0] = 0
        hits = np.diag(confusion)
        iou = hits / np.maximum(confusion.sum(0) + confusion.sum(1) - hits, EPS)
        return {"pq": sq * rq, "sq": sq, "rq": rq, "iou": iou}


def _counts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.unique(values, return_counts=True)

"""PQ, LSTQ and PAT the plain way, as the official evaluators go about it: every class is a pass over the points.

Written from the definitions, to be measured against; nothing of ``most`` is used here. Labels are numpy arrays, classes
training ids (0 is void), and keys at most 32 bits wide.
"""

from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np

EPS = 1e-15
Labels = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # predicted classes, keys; true classes, keys


def counts(keys: np.ndarray) -> dict[int, int]:
    """How often each key occurs; 0 stands for points of other classes."""
    distinct, number = np.unique(keys[keys > 0], return_counts=True)
    return dict(zip(distinct.tolist(), number.tolist(), strict=True))


def shared(truth: np.ndarray, pred: np.ndarray) -> dict[tuple[int, int], int]:
    """Points of each pair of a true and a predicted key."""
    both = (truth > 0) & (pred > 0)
    pairs = counts((truth[both] << 32) + pred[both])
    return {(pair >> 32, pair & 0xFFFFFFFF): number for pair, number in pairs.items()}


class PlainPoints:
    """The confusion matrix, and the means of IoU over points."""

    def __init__(self, num_classes: int) -> None:
        self.num_classes = num_classes
        self.confusion = np.zeros((num_classes, num_classes), dtype=np.int64)

    def known(self, labels: Labels) -> list[np.ndarray]:
        """Count the points; return those of known truth, with keys from 1 on."""
        pred_sem, pred_key, truth_sem, truth_key = labels
        np.add.at(self.confusion, (pred_sem, truth_sem), 1)
        known = truth_sem != 0
        return [pred_sem[known], pred_key[known] + 1, truth_sem[known], truth_key[known] + 1]

    def iou(self) -> tuple[np.ndarray, np.ndarray]:
        """Of each class, and whether it occurs."""
        confusion = self.confusion.astype(np.float64)
        confusion[:, 0] = 0
        hits = np.diag(confusion)
        union = confusion.sum(0) + confusion.sum(1) - hits
        return hits / np.maximum(union, EPS), union > 0


class PlainPanoptic(PlainPoints):
    """PQ."""

    def __init__(self, num_classes: int, min_points: int) -> None:
        super().__init__(num_classes)
        self.min_points = min_points
        self.iou_sum = np.zeros(num_classes)
        self.tp, self.fp, self.fn = (np.zeros(num_classes, dtype=np.int64) for _ in range(3))

    def add(self, sequence: int, labels: Labels) -> None:
        """Add one scan."""
        self.add_known(*self.known(labels))

    def add_known(
        self, pred_sem: np.ndarray, pred_key: np.ndarray, truth_sem: np.ndarray, truth_key: np.ndarray
    ) -> dict[int, dict[int, tuple[int, float]]]:
        """Add points of known truth; return each class's matches: true key to predicted key and IoU."""
        matches: dict[int, dict[int, tuple[int, float]]] = {}
        for label in range(1, self.num_classes):
            pred, truth = pred_key * (pred_sem == label), truth_key * (truth_sem == label)
            pred_area, truth_area = counts(pred), counts(truth)
            matches[label] = {}
            for (one, other), points in shared(truth, pred).items():
                iou = points / (truth_area[one] + pred_area[other] - points)
                if iou > 0.5:
                    matches[label][one] = other, iou
            found = {other for other, _ in matches[label].values()}
            self.tp[label] += len(found)
            self.iou_sum[label] += sum(iou for _, iou in matches[label].values())
            self.fn[label] += sum(n >= self.min_points for key, n in truth_area.items() if key not in matches[label])
            self.fp[label] += sum(n >= self.min_points for key, n in pred_area.items() if key not in found)
        return matches

    def recognised(self) -> np.ndarray:
        """TP / (TP + FP / 2 + FN / 2), by TP."""
        return self.tp / np.maximum(self.tp + self.fp / 2 + self.fn / 2, EPS) / np.maximum(self.tp, EPS)

    def figures(self) -> dict[str, float]:
        """Over all scans so far."""
        return {"pq": float((self.iou_sum * self.recognised())[1:].mean())}


class PlainLSTQ(PlainPoints):
    """LSTQ of SemanticKITTI; keys are instance ids, 0 is none."""

    def __init__(self, num_classes: int, num_things: int, min_points: int) -> None:
        super().__init__(num_classes)
        self.num_things, self.min_points = num_things, min_points
        self.truth, self.pred, self.shared = Counter(), Counter(), defaultdict(Counter)

    def add(self, sequence: int, labels: Labels) -> None:
        """Add one scan of a sequence."""
        pred_sem, pred_id, truth_sem, truth_id = self.known(labels)
        pred_id, truth_id = pred_id - 1, truth_id - 1
        for label in range(1, self.num_classes):
            for key, points in counts(pred_id * (pred_sem == label)).items():
                self.pred[sequence, key] += points
            truth = truth_id * (truth_sem == label)
            enough = {key: points for key, points in counts(truth).items() if points > self.min_points}
            for key, points in enough.items():
                self.truth[sequence, label, key] += points
            for (key, other), points in shared(truth, pred_id).items():
                if key in enough:
                    self.shared[sequence, label, key][sequence, other] += points

    def figures(self) -> dict[str, float]:
        """Over all scans so far."""
        total = 0.0
        for tube, size in self.truth.items():
            for pred, points in self.shared[tube].items():
                if pred in self.pred:
                    total += points * points / (size + self.pred[pred] - points) / size
        s_assoc = total / sum(label <= self.num_things for _, label, _ in self.truth)
        iou, present = self.iou()
        s_cls = iou.sum() / present.sum()
        return {"s_assoc": s_assoc, "s_cls": float(s_cls), "lstq": float(np.sqrt(s_assoc * s_cls))}


class PlainTracking(PlainPanoptic):
    """PTQ, TQ and PAT of nuScenes; keys are whole labels, and the scans of a sequence come in order."""

    def __init__(self, num_classes: int, num_things: int, min_points: int) -> None:
        super().__init__(num_classes, min_points)
        self.num_things, self.sequence = num_things, -1
        self.switches = np.zeros(num_classes)
        self.before: dict[int, dict[int, tuple[int, float]]] = {}
        self.predicted, self.tracks = Counter(), defaultdict(list)

    def add(self, sequence: int, labels: Labels) -> None:
        """Add the next scan of a sequence."""
        if sequence != self.sequence:
            self.sequence, self.before = sequence, {}
        pred_sem, pred_key, truth_sem, truth_key = self.known(labels)
        matches = self.add_known(pred_sem, pred_key, truth_sem, truth_key)
        for label in range(1, self.num_things + 1):
            before = self.before.get(label, {})
            self.switches[label] += sum(
                key in before and before[key][0] != pred for key, (pred, _) in matches[label].items()
            )
        self.before = matches
        self.follow(pred_key, truth_sem, truth_key)

    def follow(self, pred_key: np.ndarray, truth_sem: np.ndarray, truth_key: np.ndarray) -> None:
        """Note the label of every track, 0 for none; labels are keys, which void shares with none as 1."""
        areas = counts(pred_key)
        self.predicted.update((self.sequence, key) for key, points in areas.items() if points > self.min_points)
        for label in range(1, self.num_things + 1):
            truth = truth_key * (truth_sem == label)
            truth_areas = counts(truth)
            found = {
                one: other
                for (one, other), points in shared(truth, pred_key).items()
                if points / (truth_areas[one] + areas[other] - points) > 0.5 and other != 1
            }
            for key, points in truth_areas.items():
                if points > self.min_points:
                    self.tracks[self.sequence, label, key].append(found.get(key, 0))

    def track_quality(self, sequence: int, labels: list[int]) -> float:
        """The root of association and steadiness."""
        association, scans = 0.0, len(labels)
        for label, hits in Counter(labels).items():
            if label:
                everywhere = self.predicted[sequence, label]
                association += hits**2 / (scans + (everywhere - hits if everywhere else 0)) / scans
        changes = sum(one != other or one == 0 for one, other in pairwise(labels))
        return float(np.sqrt(association * (1 - changes / max(scans - 1, 1))))

    def figures(self) -> dict[str, float]:
        """Over all scans so far."""
        pq = super().figures()["pq"]
        tq = float(np.mean([self.track_quality(track[0], labels) for track, labels in self.tracks.items()]))
        ptq = ((self.iou_sum - self.switches) * self.recognised())[self.tp + self.fn > 0].mean()
        return {"pq": pq, "tq": tq, "pat": 2 * pq * tq / (pq + tq), "ptq": float(ptq)}

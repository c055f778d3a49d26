"""PointSegMLP: which points of a centre's region of interest are its members (paper, section III, Fig. 2 d).

A pair's features are the point's (position relative to the centre, class probabilities, F_bev, F_point) and the
centre's (position, class, F_bev): Table II's variants leave out F_point, or both learned features.
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from most.errors import ConfigError
from most.geometry.boxes import along
from most.membership.evidence import Channels, Evidence
from most.membership.rating import Rating
from most.membership.roi import Pairs
from most.normed_linear import NormedLinear

REACH = 50.0  # m; brings positions to about one
SMALLEST = 0.1  # m; half-sizes below it are not divided by


@dataclass
class PointSegMLPSettings:
    """Hidden widths (with the last layer, the paper's four), and which of stage 1's features it sees."""

    widths: list[int] = field(default_factory=lambda: [64, 64, 64])
    bev: bool = True  # F_bev at the point and at the centre
    point: bool = True  # F_point

    needs = "centres"

    def __post_init__(self) -> None:
        if not self.widths or min(self.widths) < 1:
            raise ConfigError(f"membership.widths: expected at least one positive width, found {self.widths}")

    def build(self, channels: Channels) -> "PointSegMLP":
        """Make the network for a stage 1."""
        return PointSegMLP(self, channels)


class PointSegMLP(nn.Module, Rating):
    """Rates pairs of points and centres; training takes :meth:`logits` of what :meth:`describe` says of a batch."""

    def __init__(self, settings: PointSegMLPSettings, channels: Channels) -> None:
        super().__init__()
        self.settings, self.things = settings, channels.things
        of_point = 2 * 3 + channels.classes + settings.bev * channels.bev + settings.point * channels.point
        of_centre = 2 * 3 + len(channels.things) + settings.bev * channels.bev
        widths = [of_point + of_centre, *settings.widths]
        self.layers = nn.Sequential(*map(NormedLinear, widths, widths[1:]))
        self.out = nn.Linear(widths[-1], 1)

    def forward(self, evidence: Evidence, pairs: Pairs) -> Float[Tensor, "pairs"]:
        """Return O_mem of each pair: the confidence, in [0, 1], that the point is a member."""
        return self.logits(self.describe(evidence, pairs)).float().sigmoid()

    def logits(self, described: Float[Tensor, "pairs features"]) -> Float[Tensor, "pairs"]:
        """Return the logit of each pair; batch statistics are those of all pairs given."""
        logits: Tensor = self.out(self.layers(described))
        return logits.squeeze(1)

    def describe(self, evidence: Evidence, pairs: Pairs) -> Float[Tensor, "pairs features"]:
        """Return what the layers see of each pair of one sweep."""
        points, row = pairs.points.unique(return_inverse=True)  # a point in three regions is described once
        features = [
            self._geometry(evidence, pairs),
            self._points(evidence, points)[row],
            self._centres(evidence)[pairs.detections],
        ]
        return torch.cat(features, 1)

    def _geometry(self, evidence: Evidence, pairs: Pairs) -> Float[Tensor, "pairs 6"]:
        """The point's position relative to the centre, in metres, and in extents along the detection's axes."""
        detections, rows = evidence.detections, pairs.detections
        away = evidence.points[pairs.points] - detections.centres[rows]
        turned = along(away, None if detections.yaws is None else detections.yaws[rows])
        return torch.cat([away, turned / detections.extents[rows].clamp(min=SMALLEST)], 1)

    def _points(self, evidence: Evidence, points: Int64[Tensor, "used"]) -> Float[Tensor, "used features"]:
        features = [evidence.probabilities[points]]
        if self.settings.bev:
            features.append(evidence.bev_at(evidence.points[points]))
        if self.settings.point:
            features.append(evidence.point_features[points])
        return torch.cat(features, 1)

    def _centres(self, evidence: Evidence) -> Float[Tensor, "detections features"]:
        detections = evidence.detections
        things = torch.tensor(self.things, device=detections.classes.device)
        is_class = (detections.classes[:, None] == things).to(detections.centres.dtype)
        features = [detections.centres / REACH, detections.extents.clamp(min=SMALLEST).log(), is_class]
        if self.settings.bev:
            features.append(evidence.bev_at(detections.centres))
        return torch.cat(features, 1)

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from most.errors import DataError
from most.modal.build import LabelRules, build_table
from most.modal.extent import ShrinkWrap, TrackMax
from most.structures import Sweep

CAR, PERSON = 1 | 5 << 16, 2 | 1 << 16
EYE, ZERO = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)
RULES = LabelRules(lambda raw: raw & 0xFFFF, lambda classes: classes > 0, lambda raw: raw >> 16)


def rotation(angle: float) -> torch.Tensor:
    c, s = math.cos(angle), math.sin(angle)
    return torch.tensor([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=torch.float64)


def random_sweeps(seed: int, yaws: list[float]) -> list[Sweep]:
    """Two objects of random points, seen from a sensor that turns; double precision."""
    generator = torch.Generator().manual_seed(seed)
    sweeps = []
    for index, yaw in enumerate(yaws):
        counts = torch.randint(1, 12, (2,), generator=generator).tolist()
        points = torch.randn(sum(counts), 4, generator=generator, dtype=torch.float64) * 3
        labels = torch.tensor([CAR] * counts[0] + [PERSON] * counts[1])
        pose = torch.eye(4, dtype=torch.float64)
        pose[:3, :3] = rotation(yaw)
        sweeps.append(Sweep("00", index, points, pose, index / 10, labels))
    return sweeps


def moved(sweep: Sweep, linear: torch.Tensor, translation: torch.Tensor) -> Sweep:
    points = torch.cat([sweep.points[:, :3] @ linear.T + translation, sweep.points[:, 3:]], 1)
    return Sweep(sweep.sequence, sweep.index, points, sweep.pose, sweep.time, sweep.labels)


TRANSFORMS = st.builds(
    lambda angle, flip_x, flip_y, scale, *shift: (
        scale * rotation(angle) @ torch.diag(torch.tensor([flip_x, flip_y, 1.0], dtype=torch.float64)),
        torch.tensor(shift, dtype=torch.float64),
    ),
    st.floats(-math.pi, math.pi),
    st.sampled_from([-1.0, 1.0]),
    st.sampled_from([-1.0, 1.0]),
    st.floats(0.9, 1.1),
    *[st.floats(-2, 2)] * 3,
)
YAWS = st.lists(st.floats(-math.pi, math.pi), min_size=1, max_size=4)
SEEDS = st.integers(0, 10_000)


@settings(max_examples=40, deadline=None)
@given(SEEDS, YAWS, TRANSFORMS)
def test_shrink_wrap_of_moved_points_is_shrink_wrap_moved(seed, yaws, transform):
    sweeps = random_sweeps(seed, yaws)
    expected = build_table([moved(sweep, *transform) for sweep in sweeps], RULES)
    table = build_table(sweeps, RULES)
    for index in range(len(yaws)):
        ours = table.instances(index, ShrinkWrap(), *transform)
        theirs = expected.instances(index, ShrinkWrap(), EYE, ZERO)
        assert torch.allclose(ours.centres, theirs.centres, atol=1e-5)
        assert torch.allclose(ours.extents, theirs.extents, atol=1e-5)
        assert ours.keys.tolist() == theirs.keys.tolist()
        assert ours.counts.tolist() == theirs.counts.tolist()


@settings(max_examples=40, deadline=None)
@given(SEEDS, YAWS, TRANSFORMS)
def test_track_max_is_the_largest_of_all_frames_points_turned_by_their_heading(seed, yaws, transform):
    sweeps, linear = random_sweeps(seed, yaws), transform[0]
    table = build_table(sweeps, RULES)
    for index, yaw in enumerate(yaws):
        ours = table.instances(index, TrackMax(), *transform)
        for row, key in enumerate((CAR, PERSON)):
            sizes = []
            for sweep, seen_at in zip(sweeps, yaws, strict=True):
                points = sweep.points[sweep.labels == key, :3]
                turned = linear @ rotation(seen_at - yaw)
                sizes.append(((points - points.mean(0)) @ turned.T).abs().amax(0).clamp(min=0.05))
            expected = torch.stack(sizes).amax(0).float()
            assert torch.allclose(ours.extents[ours.keys == key][0], expected, atol=1e-5), row


@settings(max_examples=20, deadline=None)
@given(SEEDS, YAWS, TRANSFORMS)
def test_track_max_is_never_below_shrink_wrap(seed, yaws, transform):
    table = build_table(random_sweeps(seed, yaws), RULES)
    for index in range(len(yaws)):
        shrunk = table.instances(index, ShrinkWrap(), *transform).extents
        assert (table.instances(index, TrackMax(), *transform).extents >= shrunk - 1e-6).all()


@settings(max_examples=20, deadline=None)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-0.5, 0.5), TRANSFORMS)
def test_velocity_is_relative_to_the_ground_whatever_the_sensor_does(vx, vy, turning, transform):
    velocity = torch.tensor([vx, vy, 0.0], dtype=torch.float64)
    sweeps = []
    for index in range(4):
        pose = torch.eye(4, dtype=torch.float64)
        pose[:3, :3] = rotation(turning * index)
        pose[:3, 3] = torch.tensor([1.5 * index, 0.2 * index**2, 0.0])  # the sensor drives a curve
        world = torch.tensor([[8.0, 2, 0], [10, 3, 1]], dtype=torch.float64) + velocity * index / 10
        points = torch.cat([(world - pose[:3, 3]) @ pose[:3, :3], torch.zeros(2, 1)], 1)
        sweeps.append(Sweep("00", index, points, pose, index / 10, torch.tensor([CAR, CAR])))
    table = build_table(sweeps, RULES)
    for index in range(4):
        expected = transform[0] @ rotation(-turning * index) @ velocity
        instances = table.instances(index, ShrinkWrap(), *transform)
        assert instances.velocity_known.all()
        assert torch.allclose(instances.velocities[0], expected[:2].float(), atol=1e-4)


def test_an_instance_seen_once_has_no_velocity(rules, sweep_of):
    instances = build_table([sweep_of({CAR: [[1, 2, 3]]})], rules).instances(0, ShrinkWrap(), EYE, ZERO)
    assert instances.velocity_known.tolist() == [False]


def test_a_scan_without_instances_gives_empty_tensors(rules, sweep_of):
    instances = build_table([sweep_of({3: [[1, 2, 3]]})], rules).instances(0, TrackMax(), EYE, ZERO)
    assert len(instances) == 0
    assert instances.extents.shape == (0, 3)


def test_an_unknown_scan_is_an_error(rules, sweep_of):
    table = build_table([sweep_of({CAR: [[1, 2, 3]]}, index=4)], rules)
    for index in (3, 5):
        with pytest.raises(DataError, match=f"labelled sweep {index}"):
            table.instances(index, ShrinkWrap(), EYE, ZERO)

"""Velocities that centres tell, and the filter, which is held against the textbook's matrices in float64."""

import pytest
import torch
from scenes import seen, tracker

from most.tracking import ConstantVelocity, TrackerSettings
from most.tracking.live import Live, Sightings


def test_velocities_told_by_centres_settle():
    """The first way counts whole, 4 m/s; the second, of no motion, with 1 - exp(-1) after half a second."""
    following = tracker()
    for x, time in ((0, 0.0), (2, 0.5), (2, 1.0)):
        following.step(seen((x, 0)), None, time)
    expected = 4 * torch.exp(torch.tensor(-1.0))
    assert torch.allclose(following.tracks().velocities, torch.tensor([[expected, 0.0]]))


def one_thing(row, time):
    class_, whole = torch.tensor([1]), torch.ones(1, dtype=torch.int64)
    observed = seen(row)
    centres, velocities = observed.centres.double(), torch.nn.functional.pad(observed.velocities.double(), (0, 1))
    sighted = Sightings(class_, centres, velocities, observed.velocity_known, observed.extents, observed.scores)
    start, memory = ConstantVelocity().start(sighted)
    at = torch.tensor([time], dtype=torch.float64)
    return sighted, Live(whole, class_, centres, start, observed.extents, whole, at, at, memory)


def test_the_filter_is_the_textbooks():
    """x = (x, vx), Joseph-free update with both measurements, and with the centre alone."""
    settings, since = ConstantVelocity(), 0.4
    for row in ((3.0, 0.0), (3.0, 0.0, 5.0, 0.0)):
        _, live = one_thing((0.0, 0.0, 2.0, 0.0), 0.0)
        sighted, _ = one_thing(row, since)
        step = torch.tensor([[1, since], [0, 1]], dtype=torch.float64)
        noise = settings.acceleration**2 * torch.tensor(
            [[since**3 / 3, since**2 / 2], [since**2 / 2, since]], dtype=torch.float64
        )
        state, covariance = (
            step @ torch.tensor([0.0, 2.0], dtype=torch.float64),
            torch.diag(torch.tensor([settings.centre**2, settings.velocity**2], dtype=torch.float64)),
        )
        covariance = step @ covariance @ step.T + noise
        seen_rows = 1 if len(row) == 2 else 2
        measure = torch.eye(2, dtype=torch.float64)[:seen_rows]
        error = torch.diag(torch.tensor([settings.centre**2, settings.velocity**2], dtype=torch.float64))
        gain = covariance @ measure.T @ (measure @ covariance @ measure.T + error[:seen_rows, :seen_rows]).inverse()
        told = torch.tensor([row[0], 0.0 if seen_rows == 1 else row[2]], dtype=torch.float64)[:seen_rows]
        state = state + gain @ (told - measure @ state)
        covariance = (torch.eye(2, dtype=torch.float64) - gain @ measure) @ covariance
        centres, velocities, memory = settings.update(live, sighted, torch.tensor([since], dtype=torch.float64))
        assert torch.allclose(torch.stack([centres[0, 0], velocities[0, 0]]), state)
        assert torch.allclose(memory[0], covariance[[0, 0, 1], [0, 1, 1]])


def test_the_filter_learns_a_velocity_that_nobody_observes():
    following = tracker(TrackerSettings(motion="kalman"))
    for index in range(20):
        following.step(seen((0.3 * index, 0)), None, 0.1 * index)
    assert torch.allclose(following.tracks().velocities, torch.tensor([[3.0, 0.0]]), atol=0.1)


@pytest.mark.parametrize("settings", [TrackerSettings(), TrackerSettings(assignment="hungarian")])
@pytest.mark.parametrize("since", [1e-310, 1e-9, 1e-3])
def test_two_sightings_at_nearly_one_time_tell_no_absurd_velocity(settings, since):
    following = tracker(settings)
    numbers = [following.step(seen((x, 0)), None, time).tolist() for x, time in ((0, 0.0), (0.2, since))]
    assert torch.allclose(following.tracks().velocities, torch.tensor([[4.0, 0.0]]))  # as if 0.05 s had passed
    assert [*numbers, following.step(seen((0.1, 0)), None, 0.1).tolist()] == [[1]] * 3


def test_at_ten_scans_a_second_velocities_are_ways_over_times():
    following = tracker()
    for x, time in ((0, 0.0), (0.3, 0.1)):
        following.step(seen((x, 0)), None, time)
    assert torch.equal(following.tracks().velocities, (torch.tensor([[0.3, 0.0]]).double() / 0.1).float())


def test_poses_beyond_all_measure_are_no_crash():
    following = tracker(TrackerSettings(assignment="hungarian"))
    for index, x in enumerate((0, 1e300, 1e308, -1e308)):
        pose = torch.eye(4, dtype=torch.float64)
        pose[0, 3] = x
        assert len(following.step(seen((10, 0)), pose, 0.1 * index)) == 1

"""Identities over a few sweeps, worked out by hand."""

import math

import pytest
import torch
from scenes import CAR, OPTIONS, PERSON, both, named, nowhere, pose, seen, tracker

from most.errors import ConfigError, DataError
from most.tracking import ConstantVelocity, TrackerSettings

every_option = pytest.mark.parametrize("settings", OPTIONS, ids=named)


def numbers(following, *sweeps):
    """Step through (observations, time) without poses."""
    return [following.step(observed, None, time).tolist() for observed, time in sweeps]


@every_option
def test_things_keep_their_numbers_in_whatever_order_they_come(settings):
    told = numbers(tracker(settings), (seen((0, 0), (10, 0)), 0.0), (seen((10.3, 0), (0.2, 0.1)), 0.1))
    assert told[1] == told[0][::-1]
    assert sorted(told[0]) == [1, 2]


@every_option
def test_classes_do_not_mix(settings):
    told = numbers(tracker(settings), (seen((0, 0)), 0.0), (seen((0, 0), thing=PERSON), 0.5))
    assert told == [[1], [2]]


def test_a_known_velocity_links_what_the_nearest_centre_swaps():
    """Two cars in a lane, 6 m apart, drive 5 m between two sweeps."""
    first, second = seen((0, 0, 10, 0), (6, 0, 10, 0)), seen((5, 0, 10, 0), (11, 0, 10, 0))
    assert numbers(tracker(), (first, 0.0), (second, 0.5)) == [[1, 2], [1, 2]]
    assert numbers(tracker(TrackerSettings(motion="nearest")), (first, 0.0), (second, 0.5)) == [[1, 2], [2, 3]]


def test_a_velocity_that_is_unknown_is_told_by_the_tracks_own_centres():
    """A car drives 3 m a sweep; the third sweep is missing: 6 m are beyond its gate of 4 m but for what it did."""
    sweeps = [(seen((3 * index, 0)), 0.5 * index) for index in (0, 1, 3)]
    assert numbers(tracker(), *sweeps[:2]) == [[1], [1]]
    assert numbers(tracker(), *sweeps) == [[1], [1], [1]]
    jump = [(seen((0, 0)), 0.0), (seen((3, 0)), 0.5), (seen((11.5, 0)), 1.5)]  # gate at 1 s: 8 m, and 8.5 m away
    assert numbers(tracker(TrackerSettings(motion="nearest")), *jump) == [[1], [1], [2]]
    assert numbers(tracker(), *jump) == [[1], [1], [1]]


@pytest.mark.parametrize(("since", "away", "linked"), [
    (0.1, 3.9, True), (0.1, 4.1, False), (0.5, 3.9, True), (0.5, 4.1, False), (1.0, 7.9, True), (1.0, 8.1, False),
])  # fmt: skip
def test_gates_hold_for_half_a_second_and_grow_with_time(since, away, linked):
    first, second = numbers(tracker(), (seen((0, 0)), 0.0), (seen((away, 0)), since))
    assert (first == second) == linked


@pytest.mark.parametrize(("since", "linked"), [(1.5, True), (1.6, False)])
def test_tracks_end_after_a_second_and_a_half_out_of_sight(since, linked):
    told = numbers(tracker(), (seen((0, 0)), 0.0), (seen(), since / 2), (seen((0, 0)), since))
    assert (told[0] == told[2]) == linked
    assert told[1] == []


def test_the_most_confident_chooses_first_and_hungarian_the_least_way():
    """Tracks at 0 and 3; a confident observation at 1.4 and a doubtful one at -1: both are nearest to 0."""
    first, second = seen((0, 0), (3, 0)), seen((1.4, 0), (-1, 0), scores=[0.9, 0.2])
    assert numbers(tracker(), (first, 0.0), (second, 0.5))[1] == [1, 2]
    hungarian = TrackerSettings(assignment="hungarian")
    assert numbers(tracker(hungarian), (first, 0.0), (second, 0.5))[1] == [2, 1]


def test_of_equal_scores_the_nearest_pair_comes_first():
    first, second = seen((0, 0), (3, 0)), seen((1.4, 0), (-1, 0))
    assert numbers(tracker(), (first, 0.0), (second, 0.5))[1] == [2, 1]


@every_option
def test_a_jump_of_the_sensor_is_no_motion_of_things(settings):
    """The sensor jumps 100 m ahead and turns right round: parked cars stay who they are."""
    following = tracker(settings)
    before = following.step(seen((20, 0), (30, 5)), pose(), 0.0)
    after = following.step(seen((80, 0), (70, -5)), pose(100, 0, math.pi), 0.1)
    assert torch.equal(before, after)
    assert following.tracks().velocities.abs().max() < 1e-3


def test_velocities_are_relative_to_the_ground_along_the_axes_of_the_sensor():
    """Seen from a sensor turned left by 90 degrees, a car that drives along the world's x drives to the right."""
    following = tracker()
    following.step(seen((10, 0, 0, -8)), pose(turn=math.pi / 2), 0.0)  # in the world at (0, 10), driving along x
    assert following.step(seen((4, 10)), pose(), 0.5).tolist() == [1]
    assert torch.allclose(following.tracks().velocities, torch.tensor([[8.0, 0.0]]), atol=1e-6)


def test_tracks_tell_where_things_out_of_sight_are_expected():
    following = tracker()
    following.step(seen((0, 0, 10, 0)), pose(), 100.0)
    following.step(seen((11, 0, 10, 0), (50, 0)), pose(-1), 101.0)
    following.step(seen(), pose(10), 101.5)
    tracks = following.tracks()
    assert tracks.ids.tolist() == [1, 2]
    assert tracks.classes.tolist() == [CAR, CAR]
    assert torch.allclose(tracks.centres, torch.tensor([[5.0, 0, -1], [39, 0, -1]]))  # 10 + 5 m on, from 10 m on
    assert tracks.hits.tolist() == [2, 1]
    assert (tracks.first_seen.tolist(), tracks.last_seen.tolist()) == ([100.0, 101.0], [101.0, 101.0])


def test_without_poses_the_sensor_frame_is_the_world_and_a_lost_pose_stays():
    assert numbers(tracker(), (seen((0, 0)), 0.0), (seen((1, 0)), 0.5)) == [[1], [1]]
    following = tracker()
    following.step(seen((0, 0)), pose(100), 0.0)
    assert following.step(seen((0, 0)), None, 0.1).tolist() == [1]


@pytest.mark.parametrize("time", [1.0, 0.5, math.nan, math.inf])
def test_late_sweeps_are_refused_and_change_nothing(time):
    following = tracker()
    following.step(seen((0, 0)), None, 1.0)
    before = following.state()
    with pytest.raises(DataError, match=rf"sweep at {time} s: expected a time after the last sweep's 1.0 s; leave"):
        following.step(seen((0, 0)), None, time)
    assert all(torch.equal(value, following.state()[name]) for name, value in before.items())
    assert following.step(seen((0, 0)), None, 1.1).tolist() == [1]


def test_what_is_not_finite_is_refused_and_changes_nothing():
    following = tracker()
    with pytest.raises(DataError, match=r"expected a finite pose, found .*nan"):
        following.step(seen((0, 0)), pose(math.nan), 0.0)
    with pytest.raises(DataError, match="expected finite centres and velocities"):
        following.step(seen((math.inf, 0)), pose(), 0.0)
    with pytest.raises(DataError, match="expected finite centres and velocities"):
        following.step(seen((0, 0, math.inf, 0)), pose(), 0.0)
    assert following.step(seen((0, 0)), pose(), 0.0).tolist() == [1]


@every_option
def test_what_is_nowhere_gets_a_number_and_no_track(settings):
    """Neither does it go on with a car at the sensor, nor does the next car there go on with it."""
    following, car = tracker(settings), seen((0, 0))
    said = [
        following.step(observed, None, 0.1 * index).tolist()
        for index, observed in enumerate([nowhere(1), car, both(nowhere(2), car), nowhere(1)])
    ]
    assert said == [[1], [2], [3, 4, 2], [5]]
    assert following.tracks().ids.tolist() == [2]


def test_numbers_of_what_is_nowhere_are_used_again():
    following = tracker(largest=3)
    following.step(seen((0, 0)), None, 0.0)
    said = [following.step(both(seen((0, 0)), nowhere(1)), None, 0.1 * index).tolist() for index in range(1, 5)]
    assert said == [[1, 2], [1, 3], [1, 2], [1, 3]]


def test_numbers_stay_within_a_class_or_a_sequence():
    first = both(seen((0, 0)), seen((5, 5), thing=PERSON))
    assert numbers(tracker(by_class=False), (first, 0.0)) == [[1, 2]]
    assert numbers(tracker(by_class=True), (first, 0.0)) == [[1, 1]]


def test_numbers_that_run_out_are_those_of_the_longest_dead():
    """Three numbers. 2 dies before 1; the car at 40 keeps 3."""
    following = tracker(largest=3)
    assert following.step(seen((0, 0), (20, 0), (40, 0)), None, 0.0).tolist() == [1, 2, 3]
    assert following.step(seen((0, 0), (40, 0)), None, 1.0).tolist() == [1, 3]
    assert following.step(seen((40, 0)), None, 2.0).tolist() == [3]  # 2 is dead
    assert following.step(seen((40, 0)), None, 3.0).tolist() == [3]  # 1 is dead
    assert following.step(seen((40, 0), (60, 0), (80, 0), (99, 0)), None, 3.5).tolist() == [3, 2, 1, 3]  # one too many
    assert following.step(seen((40, 0)), None, 5.0).tolist() == [3]
    assert following.step(seen((40, 0), (60, 9)), None, 5.1).tolist() == [3, 2]  # 3 lives in one of its two tracks


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TrackerSettings(assignment="best"), "tracker.assignment: expected greedy or hungarian, found best"),
        (lambda: TrackerSettings(motion="none"), "tracker.motion: expected velocity, nearest or kalman, found none"),
        (lambda: TrackerSettings(lost_after=0.0), "tracker.lost_after: expected seconds above 0, found 0.0"),
        (lambda: ConstantVelocity(centre=-1.0), "tracker.kalman.centre: expected a number above 0, found -1.0"),
        (lambda: ConstantVelocity(velocity=math.nan), "tracker.kalman.velocity"),
    ],
)
def test_settings_out_of_range_are_refused(make, message):
    with pytest.raises(ConfigError, match=message):
        make()


def test_another_trackers_state_is_refused():
    following = tracker()
    following.step(seen((0, 0), (9, 9)), None, 0.0)
    with pytest.raises(DataError, match="of the same motion"):
        tracker(TrackerSettings(motion="kalman")).restore(following.state())
    with pytest.raises(DataError, match="expected numbers up to 1, found larger"):
        tracker(largest=1).restore(following.state())

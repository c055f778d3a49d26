import math

import torch

from most.modal.build import build_table, centred_differences

CAR, MOVING_CAR, PERSON, ROAD = 1 | 5 << 16, 11 | 5 << 16, 2 | 1 << 16, 3


def test_rows_hold_what_the_points_say(rules, sweep_of):
    clouds = {ROAD: [[0, 0, 0]], PERSON: [[4, 4, 1]], CAR: [[1, 0, 0], [3, 0, 1], [2, 3, 0.5]]}
    table = build_table([sweep_of(clouds, index=7, at=(10.0, 20.0, 30.0))], rules)
    assert table.frames.tolist() == [7]
    assert table.keys.tolist() == sorted([PERSON, CAR])
    assert dict(zip(table.keys.tolist(), table.classes.tolist(), strict=True)) == {CAR: 1, PERSON: 2}
    car = table.keys.tolist().index(CAR)
    assert table.counts[car] == 3
    assert table.centres[car].tolist() == [2, 1, 0.5]
    assert table.world_centres[car].tolist() == [12, 21, 30.5]
    assert table.outlines.heights[car] == 0.5


def test_the_whole_raw_label_is_the_instance(rules, sweep_of):
    table = build_table([sweep_of({CAR: [[1, 0, 0]], MOVING_CAR: [[9, 0, 0]]})], rules)
    assert table.classes.tolist() == [1, 1]
    assert table.centres[:, 0].tolist() == [1, 9]
    assert len(set(table.tracks.tolist())) == 2


def test_things_without_an_instance_are_void(rules, sweep_of):
    table = build_table([sweep_of({1: [[1, 0, 0]], ROAD | 4 << 16: [[2, 0, 0]], PERSON: [[3, 0, 0]]})], rules)
    assert table.keys.tolist() == [PERSON]


def test_frames_without_instances_or_labels(rules, sweep_of):
    unlabelled = sweep_of({CAR: [[1, 0, 0]]}, index=1)
    unlabelled.labels = None
    table = build_table([sweep_of({ROAD: [[1, 0, 0]]}), unlabelled, sweep_of({CAR: [[1, 0, 0]]}, index=2)], rules)
    assert table.frames.tolist() == [0, 2]
    assert table.starts.tolist() == [0, 0, 1]
    assert len(build_table([], rules)) == 0


def test_outlines_are_in_world_heading(rules, sweep_of):
    # From a sensor turned left by 90 degrees, what lies ahead lies along the world's y.
    table = build_table([sweep_of({CAR: [[3, 0, 0], [5, 0, 0]]}, yaw=math.pi / 2)], rules)
    assert torch.allclose(table.outlines.vertices, torch.tensor([[0.0, -1.0], [0.0, 1.0]]), atol=1e-6)


def differences(tracks, times, xs, max_gap=0.35):
    centres = torch.tensor([[x, 0.0, 0.0] for x in xs], dtype=torch.float64)
    times = torch.tensor(times, dtype=torch.float64)
    velocity, known = centred_differences(torch.tensor(tracks), times, centres, max_gap)
    return velocity[:, 0].tolist(), known.tolist()


def test_differences_are_centred_and_one_sided_at_the_ends():
    velocity, known = differences([0, 0, 0], [0.0, 0.25, 0.5], [0.0, 1.0, 4.0])
    assert velocity == [4.0, 8.0, 12.0]
    assert known == [True, True, True]


def test_no_velocity_across_tracks_or_gaps():
    velocity, known = differences([0, 1, 0, 1, 2], [0.0, 0.0, 0.25, 0.5, 0.5], [0.0, 7.0, 2.0, 9.0, 5.0])
    assert known == [True, False, True, False, False]
    assert velocity == [8.0, 0.0, 8.0, 0.0, 0.0]


def test_a_longer_gap_may_be_allowed():
    assert differences([0, 0], [0.0, 0.5], [0.0, 1.0], max_gap=0.6) == ([2.0, 2.0], [True, True])

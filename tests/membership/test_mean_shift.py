"""Mean shift against answers worked out by hand and a plain one, point by point, in float64."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from most.errors import ConfigError
from most.membership import MeanShift
from most.membership.mean_shift import mean_shift, modes


def plainly(votes, bandwidth):
    """Each vote climbs by itself to the mean of what is near, until it stands still."""
    ends = votes.copy()
    for _ in range(300):
        near = np.linalg.norm(ends[:, None] - votes[None], axis=2) <= bandwidth
        moved = near @ votes / near.sum(1, keepdims=True)
        if np.abs(moved - ends).max() < 1e-6:
            break
        ends = moved
    return ends


def blobs(*centres, spread=0.15, each=30, seed=0):
    """Votes about some centres."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(centre, spread, (each, 3)) for centre in centres])


def test_votes_about_two_centres_are_two_clusters():
    found = mean_shift(blobs((0, 0, 0), (2, 0, 0)), 1.2)
    assert [set(half.tolist()) for half in np.split(found, 2)] in ([{0}, {1}], [{1}, {0}])


def test_centres_within_a_bandwidth_are_one_cluster():
    assert set(mean_shift(blobs((0, 0, 0), (0.6, 0, 0)), 1.2).tolist()) == {0}


def test_height_tells_apart_too():
    assert len(set(mean_shift(blobs((0, 0, 0), (0, 0, 2.5)), 1.2).tolist())) == 2


def test_modes_are_where_the_plain_ascent_ends():
    votes = np.round(blobs((0, 0, 0), (3, 1, 0), (-2, 4, 1)) * 10) / 10 + 0.05  # the middles of cells of 0.1 m
    found = modes(votes, np.ones(len(votes), dtype=np.int64), 1.2)
    ends = plainly(votes, 1.2)
    assert len(found) == 3
    assert np.linalg.norm(ends[:, None] - found[None], axis=2).min(1).max() < 0.01


def test_one_vote_and_votes_in_one_place_are_one_cluster():
    for votes in (np.zeros((1, 3)), np.full((7, 3), -2.5)):
        assert mean_shift(votes, 1.2).tolist() == [0] * len(votes)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 80))
def test_order_does_not_matter_and_clusters_are_counted_without_gaps(seed, count):
    rng = np.random.default_rng(seed)
    votes, order = rng.uniform(0, 4, (count, 3)), rng.permutation(count)
    found = mean_shift(votes, 1.2)
    assert sorted(set(found.tolist())) == list(range(found.max() + 1))
    assert np.array_equal(mean_shift(votes[order], 1.2), found[order])


def test_a_bandwidth_of_nothing_is_refused():
    with pytest.raises(ConfigError, match=r"membership\.bandwidth: expected metres above 0, found 0\.0"):
        MeanShift(bandwidth=0.0)

import torch
from hypothesis import given
from hypothesis import strategies as st

from most.modal.voxel_labels import majority


def vote(pairs, num_voxels, num_classes=4):
    table = torch.tensor(pairs, dtype=torch.int64).reshape(-1, 2)
    return majority(table[:, 0], table[:, 1], num_voxels, num_classes).tolist()


def test_most_points_win():
    assert vote([(0, 3), (0, 1), (0, 3), (1, 2)], 2) == [3, 2]


def test_ties_go_to_the_lower_id():
    assert vote([(0, 3), (0, 2), (0, 3), (0, 2)], 1) == [2]


def test_void_does_not_vote():
    assert vote([(0, 0), (0, 0), (0, 2), (2, 0)], 3) == [2, 0, 0]


def test_nothing_at_all():
    assert vote([], 2) == [0, 0]


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3)), max_size=40))
def test_it_is_what_counting_says(pairs):
    expected = []
    for voxel in range(6):
        votes = [semantic for at, semantic in pairs if at == voxel and semantic]
        expected.append(min(set(votes), key=lambda s: (-votes.count(s), s)) if votes else 0)
    assert vote(pairs, 6) == expected

import torch
from hypothesis import given
from hypothesis import strategies as st

from most.geometry.means import group_means


def test_means_and_sizes_of_groups_one_of_them_empty() -> None:
    means, sizes = group_means(torch.tensor([[1.0, 0.0], [5.0, 2.0], [3.0, 4.0]]), torch.tensor([2, 0, 2]), 3)
    assert means.tolist() == [[5.0, 2.0], [0.0, 0.0], [2.0, 2.0]]
    assert sizes.tolist() == [1, 0, 2]


def test_sums_in_half_precision_do_not_stop_growing() -> None:
    """In bfloat16 257 is 256, and 256 ones and a three would have the mean 260 / 257."""
    values = torch.cat([torch.ones(256, 1), torch.full((1, 1), 3.0)]).bfloat16()
    means, _ = group_means(values, torch.zeros(257, dtype=torch.int64), 1)
    assert means.dtype == torch.float32
    torch.testing.assert_close(means, torch.tensor([[259 / 257]]), rtol=1e-6, atol=0.0)


@given(groups=st.lists(st.integers(0, 4), max_size=30), seed=st.integers(0, 99))
def test_sums_of_groups_add_up_to_the_sum_of_all(groups: list[int], seed: int) -> None:
    values = torch.randn(len(groups), 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    means, sizes = group_means(values, torch.tensor(groups, dtype=torch.int64), 5)
    assert means.dtype == torch.float64
    torch.testing.assert_close((means * sizes[:, None]).sum(0), values.sum(0))

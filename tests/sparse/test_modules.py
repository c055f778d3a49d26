"""The modules are thin: weights of the right shape, sites where they belong."""

import pytest
import torch

from most.sparse import InverseConv, Sites, SparseTensor, StridedConv, SubmanifoldConv


def line() -> SparseTensor:
    return SparseTensor(torch.tensor([[1.0], [10.0]]), Sites(torch.tensor([[0, 0, 0, 0], [0, 0, 0, 1]]), (4, 4, 4), 1))


def test_submanifold_by_hand() -> None:
    """Out at z: tap 0 times the cell below, tap 1 times the cell, tap 2 times the cell above, plus the bias."""
    conv = SubmanifoldConv(1, 1, (1, 1, 3), bias=True)
    with torch.no_grad():
        conv.weight.copy_(torch.tensor([2.0, 3.0, 5.0]).view(1, 1, 1, 3, 1))
        conv.bias.fill_(0.5)  # type: ignore[union-attr]
    x = line()
    out = conv(x)
    assert out.sites is x.sites
    assert out.features.flatten().tolist() == [3 * 1 + 5 * 10 + 0.5, 2 * 1 + 3 * 10 + 0.5]


def test_down_and_up_lead_back_to_the_same_sites() -> None:
    x = line()
    down, up = StridedConv(1, 1, 2), InverseConv(1, 1, 2)
    with torch.no_grad():
        for conv in (down, up):
            conv.weight.copy_(torch.arange(1.0, 9.0).view(1, 2, 2, 2, 1))
    coarse = down(x)
    assert coarse.features.tolist() == [[1 * 1 + 2 * 10]]
    fine = up(coarse, x.sites)
    assert fine.sites is x.sites
    assert fine.features.flatten().tolist() == [21, 42]


def test_weights_lie_as_spconv_has_them() -> None:
    assert SubmanifoldConv(5, 7, (3, 1, 3)).weight.shape == (7, 3, 1, 3, 5)
    assert StridedConv(5, 7, 3).weight.shape == (7, 3, 3, 3, 5)
    assert InverseConv(5, 7, 2).weight.shape == (7, 2, 2, 2, 5)


def test_inverse_refuses_other_sites() -> None:
    x = line()
    other = Sites(torch.tensor([[0, 0, 0, 0], [0, 3, 3, 3]]), (4, 4, 4), 1)
    with pytest.raises(ValueError, match="expected 2 sites, found 1"):
        InverseConv(1, 1, 2)(StridedConv(1, 1, 2)(x), other)

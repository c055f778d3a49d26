"""The BEV branch against dense operations."""

import torch
import torch.nn.functional as F

from most.backbones.bev import BevBranch, ColumnConv
from most.sparse import Sites, SparseTensor


def test_column_convolution_equals_a_dense_one() -> None:
    """Columns at the corners and edges of the map, in two samples; result and gradients."""
    conv = ColumnConv(3, 4).double()
    columns = torch.tensor([[0, 0, 0], [0, 4, 5], [0, 4, 4], [1, 0, 5], [1, 2, 3]])
    features = torch.randn(5, 3, dtype=torch.float64, requires_grad=True)
    dense = torch.zeros(2, 5, 6, 3, dtype=torch.float64).index_put(columns.unbind(1), features).permute(0, 3, 1, 2)
    expected, found = F.conv2d(dense, conv.weight, padding=1), conv(features, columns, (2, 5, 6))
    torch.testing.assert_close(found, expected)
    direction = torch.randn_like(found)
    inputs = (features, conv.weight)
    torch.testing.assert_close(
        torch.autograd.grad((found * direction).sum(), inputs),
        torch.autograd.grad((expected * direction).sum(), inputs),
    )


def test_columns_are_stacked_lowest_first() -> None:
    """Two voxels of one column, at heights 0 and 2 of 3, and one of another."""
    sites = Sites(torch.tensor([[0, 1, 1, 0], [0, 1, 1, 2], [0, 1, 2, 1]]), (4, 4, 3), 1)
    branch = BevBranch(2, 3, 5, squeeze=False)
    x = SparseTensor(torch.tensor([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), sites)
    stack = branch._stack(x, 2, torch.tensor([0, 0, 1]))
    assert stack.tolist() == [[1, 2, 0, 0, 3, 4], [0, 0, 5, 6, 0, 0]]


def test_voxels_of_a_column_receive_the_same() -> None:
    sites = Sites(torch.tensor([[0, 1, 1, 0], [0, 1, 1, 2], [0, 1, 2, 1]]), (4, 4, 3), 1)
    branch = BevBranch(2, 3, 5, squeeze=False).eval()
    x = SparseTensor(torch.randn(3, 2), sites)
    voxels, bev = branch(x)
    added = voxels.features - x.features
    torch.testing.assert_close(added[0], added[1])
    torch.testing.assert_close(added[2], branch.back(bev[0, :, 1, 2]))

import pytest
import torch
from torch import nn

from most.normed_linear import NormedLinear


def ordinary(layer, x):
    return nn.functional.relu(layer.norm(layer.linear(x)))


@pytest.mark.parametrize(("width_in", "width_out"), [(3, 5), (4, 4), (6, 2)])
def test_equals_linear_norm_relu_with_its_gradients_and_running_statistics(width_in, width_out):
    torch.manual_seed(0)
    folded, plain = NormedLinear(width_in, width_out).double(), NormedLinear(width_in, width_out).double()
    nn.init.uniform_(folded.norm.weight, 0.5, 2.0)
    nn.init.normal_(folded.norm.bias)
    plain.load_state_dict(folded.state_dict())
    x = (torch.randn(40, width_in, dtype=torch.float64) + 3).requires_grad_()
    y = x.detach().clone().requires_grad_()
    signal = torch.randn(40, width_out, dtype=torch.float64)
    (folded(x) * signal).sum().backward()
    (ordinary(plain, y) * signal).sum().backward()
    assert torch.allclose(x.grad, y.grad, atol=1e-9)
    for one, other in zip(folded.parameters(), plain.parameters(), strict=True):
        assert torch.allclose(one.grad, other.grad, atol=1e-9)
    for name in ("running_mean", "running_var"):
        assert torch.allclose(getattr(folded.norm, name), getattr(plain.norm, name), atol=1e-12)
    assert torch.allclose(folded.eval()(x), ordinary(plain.eval(), x), atol=1e-12)


@pytest.mark.parametrize("rows", [0, 1])
def test_too_few_rows_for_statistics_use_the_running_ones(rows):
    layer = NormedLinear(3, 4)
    assert torch.equal(layer(torch.ones(rows, 3)), layer.eval()(torch.ones(rows, 3)))


def test_half_precision_keeps_its_statistics_exact():
    torch.manual_seed(0)
    layer = NormedLinear(4, 8)
    x = torch.randn(500, 4) + 5
    with torch.autocast("cpu", dtype=torch.bfloat16):
        rough = layer(x)
    assert rough.dtype == torch.bfloat16
    assert torch.allclose(rough.float(), NormedLinear.forward(layer, x), atol=0.2)

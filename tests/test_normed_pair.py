import pytest
import torch
from torch import nn

from most import normed_pair
from most.normed_pair import NormedPair, relu_product


def double(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, requires_grad=True)


@pytest.mark.parametrize("rows", [0, 1, 7, 8])
def test_product_through_the_hidden_layer_has_exact_gradients(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(normed_pair, "BLOCK", 3)  # rows end within a block, and at the end of one
    torch.manual_seed(0)
    inputs = double(rows, 2), double(6, 2), double(6), double(3, 6)
    x, weight, bias, out_weight = inputs
    expected = torch.relu(x @ weight.T + bias) @ out_weight.T
    torch.testing.assert_close(relu_product(*inputs), expected)
    assert torch.autograd.gradcheck(relu_product, inputs)


@pytest.mark.parametrize("training", [True, False])
def test_pair_equals_its_layers_one_after_the_other(training: bool) -> None:
    torch.manual_seed(0)
    pair = NormedPair(3, 8, 2).double()
    for layer in (pair.wide, pair.narrow):
        nn.init.uniform_(layer.norm.weight, 0.5, 2.0)
        nn.init.normal_(layer.norm.bias)
    other = NormedPair(3, 8, 2).double()
    other.load_state_dict(pair.state_dict())
    pair.train(training)
    other.train(training)
    x, y = (torch.linspace(-2, 3, 60, dtype=torch.float64).view(20, 3).sin().requires_grad_() for _ in range(2))
    signal = torch.randn(20, 2, dtype=torch.float64)
    (pair(x) * signal).sum().backward()
    (other.narrow(other.wide(y)) * signal).sum().backward()
    torch.testing.assert_close(x.grad, y.grad)
    for one, same in zip(pair.parameters(), other.parameters(), strict=True):
        torch.testing.assert_close(one.grad, same.grad)
    torch.testing.assert_close(pair.state_dict(), other.state_dict())


@pytest.mark.parametrize("rows", [0, 1])
def test_too_few_rows_for_statistics_use_the_running_ones(rows: int) -> None:
    pair = NormedPair(3, 8, 2)
    assert torch.equal(pair(torch.ones(rows, 3)), pair.eval()(torch.ones(rows, 3)))


def test_half_precision_stays_near_the_full_one() -> None:
    torch.manual_seed(0)
    pair, x = NormedPair(4, 16, 4), torch.randn(500, 4)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        rough = pair(x)
    rough.float().square().sum().backward()
    assert rough.dtype == torch.bfloat16
    torch.testing.assert_close(rough.float(), pair(x), atol=0.2, rtol=0)
    assert all(parameter.grad is not None and parameter.grad.isfinite().all() for parameter in pair.parameters())

import torch

from most.geometry.similarity import Similarity


def test_identity_moves_nothing() -> None:
    points = torch.tensor([[1.0, 2.0, 3.0]])
    assert torch.equal(Similarity.identity().apply(points), points)


def test_mirror_scale_and_move_by_hand() -> None:
    change = Similarity(
        torch.diag(torch.tensor([-2.0, 2.0, 2.0], dtype=torch.float64)), torch.tensor([1.0, 0, 0]).double()
    )
    moved = change.apply(torch.tensor([[1.0, 2.0, 3.0]]))
    assert moved.dtype == torch.float32
    assert moved.tolist() == [[-1.0, 4.0, 6.0]]

"""The pool of pairs that stage 2 draws from."""

import pytest
import torch

from most.errors import ConfigError
from most.membership import LabelledPairs, Mixing, PairPool
from most.stages.membership import MembershipTraining


def scan(number: int, pairs: int = 4) -> LabelledPairs:
    """Pairs whose one feature is the scan's number."""
    return LabelledPairs(torch.full((pairs, 1), float(number)), torch.arange(pairs) % 2.0)


def drawn(pool: PairPool) -> list[float]:
    return sorted(pool.draw().described[:, 0].tolist())


def test_the_scans_seen_last_are_kept():
    pool = PairPool(Mixing(scans=3, pairs=100), seed=1)
    pool.add([scan(0), scan(1)])
    assert drawn(pool) == [0.0] * 4 + [1.0] * 4
    pool.add([scan(2), scan(3)])
    assert drawn(pool) == [1.0] * 4 + [2.0] * 4 + [3.0] * 4


def test_pairs_keep_their_truth_and_none_is_drawn_twice():
    pool = PairPool(Mixing(scans=2, pairs=100), seed=1)
    described = torch.arange(40.0)[:, None]
    pool.add([LabelledPairs(described[:20], torch.zeros(20)), LabelledPairs(described[20:], torch.ones(20))])
    pairs = pool.draw()
    assert pairs.described.dtype == torch.float32
    assert sorted(pairs.described[:, 0].tolist()) == described[:, 0].tolist()
    assert torch.equal(pairs.members, (pairs.described[:, 0] >= 20).float())


def test_a_scan_with_many_pairs_has_no_more_say_than_its_share():
    pool = PairPool(Mixing(scans=2, pairs_per_scan=3, pairs=100), seed=1)
    pool.add([scan(0, 500), scan(1, 2)])
    assert drawn(pool) == [0.0] * 3 + [1.0] * 2


def test_every_step_draws_others():
    pool = PairPool(Mixing(scans=1, pairs=10), seed=1)
    pool.add([LabelledPairs(torch.arange(1000.0)[:, None], torch.zeros(1000))])
    assert len(pool.draw()) == 10
    assert drawn(pool) != drawn(pool)


def test_a_restored_pool_goes_on_with_the_same_pairs():
    def begun(seed: int = 1) -> PairPool:
        pool = PairPool(Mixing(scans=4, pairs_per_scan=5, pairs=6), seed)
        pool.add([scan(number, 9) for number in range(3)])
        pool.draw()
        return pool

    whole, stopped, restored = begun(), begun(), PairPool(Mixing(scans=4, pairs_per_scan=5, pairs=6), 1)
    restored.restore(stopped.state())
    for pool in (whole, restored):
        pool.add([LabelledPairs(torch.arange(9.0)[:, None], torch.ones(9))])
    for _ in range(3):
        assert torch.equal(whole.draw().described, restored.draw().described)
    assert begun(2).draw().described.tolist() != begun(1).draw().described.tolist()


def test_scans_without_pairs_are_no_error():
    pool = PairPool(Mixing(scans=2), seed=1)
    pool.add([scan(0, 0)])
    assert len(pool.draw()) == 0


@pytest.mark.parametrize("name", ["scans", "pairs_per_scan", "steps", "pairs"])
def test_impossible_numbers_are_refused(name: str):
    with pytest.raises(ConfigError, match=rf"stage\.membership\.mixing\.{name}: expected at least"):
        Mixing(**{name: -1})


def test_a_pool_smaller_than_a_batch_would_drop_scans_unseen():
    with pytest.raises(ConfigError, match=r"mixing\.scans: expected 0, or at least .* = 8, found 4"):
        MembershipTraining(batch_size=8, mixing=Mixing(scans=4))

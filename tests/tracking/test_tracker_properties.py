"""What holds of every tracker, whatever it sees."""

import io

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import OPTIONS, World, named, pose, seen, tracker

from most.structures import Observations

every_option = pytest.mark.parametrize("option", OPTIONS, ids=named)
seeds = st.integers(0, 2**31 - 1)
few = settings(max_examples=8)  # of each option


def poses(seed, count):
    """A sensor that goes and turns as it likes, jumps included."""
    steps = torch.rand(count, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return [pose(*(row * torch.tensor([400.0, 400.0, 6.0]) - 200).tolist()) for row in steps]


def crowd(generator):
    """Things in each other's way, some of them alike but for their place."""
    count = int(torch.randint(0, 12, (1,), generator=generator))
    rand = torch.rand(count, 8, generator=generator)
    scores = (rand[:, 0] * 3).round() / 3
    return Observations(
        1 + (rand[:, 1] > 0.5).long(), rand[:, 2:5] * 12, torch.ones(count, 3), rand[:, 5:7] * 4 - 2, rand[:, 7] > 0.5,
        scores, torch.rand(count, generator=generator) > 0.1,
    )  # fmt: skip


@every_option
@few
@given(seed=seeds)
def test_the_order_of_observations_does_not_matter(option, seed):
    generator = torch.Generator().manual_seed(seed)
    one, other = tracker(option), tracker(option)
    for index in range(6):
        observed = crowd(generator)
        order = torch.randperm(len(observed), generator=generator)
        numbers = one.step(observed, None, 0.2 * index)
        assert torch.equal(other.step(observed.select(order), None, 0.2 * index), numbers[order])


@every_option
@few
@given(seed=seeds)
def test_numbers_of_one_sweep_differ_and_start_from_one(option, seed):
    generator, following = torch.Generator().manual_seed(seed), tracker(option)
    for index in range(6):
        numbers = following.step(crowd(generator), None, 0.2 * index).tolist()
        assert len(set(numbers)) == len(numbers)
        assert all(1 <= number <= 65535 for number in numbers)


@every_option
@few
@given(seed=seeds)
def test_a_sequence_goes_on_from_a_saved_state_to_the_bit(option, seed):
    whole, first, second = (tracker(option, largest=9, by_class=True) for _ in range(3))
    generator, ways = torch.Generator().manual_seed(seed), poses(seed, 8)
    sweeps = [(crowd(generator), way, 0.4 * index) for index, way in enumerate(ways)]
    told = [whole.step(*sweep) for sweep in sweeps]
    again = [first.step(*sweep) for sweep in sweeps[:4]]
    file = io.BytesIO()
    torch.save(first.state(), file)
    file.seek(0)
    second.restore(torch.load(file, weights_only=True))
    first.step(seen((0, 0)), None, 99.0)  # the state is its own from here on
    again += [second.step(*sweep) for sweep in sweeps[4:]]
    assert all(torch.equal(one, other) for one, other in zip(told, again, strict=True))
    for name, value in whole.state().items():
        assert torch.equal(value, second.state()[name]), name


@every_option
@few
@given(seed=seeds)
def test_the_past_does_not_depend_on_what_follows(option, seed):
    generator = torch.Generator().manual_seed(seed)
    past = [crowd(generator) for _ in range(3)]
    told = []
    for _ in range(2):
        following = tracker(option)
        told.append([following.step(observed, None, 0.3 * index).tolist() for index, observed in enumerate(past)])
        following.step(crowd(generator), None, 0.9)
    assert told[0] == told[1]


@every_option
@few
@given(seed=seeds)
def test_things_keep_their_numbers_wherever_the_sensor_is_and_whatever_is_missed(option, seed):
    """Sweeps 0.3 s apart from anywhere; one sweep is dropped, one sees nothing, and one thing at a time is hidden."""
    world, following, told = World.random(seed), tracker(option), {}
    for index, where in enumerate(poses(seed, 10)):
        if index == 3:
            continue
        observed = world.observed(where, 0.3 * index)
        there = (
            torch.arange(len(world.classes)) != index if index != 6 else torch.zeros(len(observed), dtype=torch.bool)
        )
        numbers = following.step(observed.select(there), where, 0.3 * index)
        for thing, number in zip(there.nonzero().flatten().tolist(), numbers.tolist(), strict=True):
            assert told.setdefault(thing, number) == number
    assert len(set(told.values())) == len(world.classes)


def test_ten_thousand_sweeps_leave_no_more_behind_than_the_live_tracks():
    """Every twentieth sweep sees three new things, each once; there are 50 numbers."""
    following, sizes, largest = tracker(largest=50, by_class=True), [], 0
    nothing = seen()
    for index in range(10_000):
        observed = nothing if index % 20 else seen(*[(float(10 * index + 20 * thing), 0.0) for thing in range(3)])
        largest = max(largest, *following.step(observed, None, 0.1 * index).tolist(), 0)
        if index in (500, 9_995):
            sizes.append(sum(value.numel() for value in following.state().values()))
    assert sizes[0] == sizes[1]
    assert largest == 50

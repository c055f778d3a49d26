"""Numbers that run out."""

from most.tracking.numbers import Numbers


def test_a_shared_number_is_free_once_the_last_of_its_tracks_is_dead():
    numbers, thing = Numbers(2, by_class=True), 4
    assert [numbers.take(thing) for _ in range(3)] == [1, 2, 2]
    numbers.release([(thing, 2)], alive=[(thing, 1), (thing, 2)])
    assert len(numbers.state()[1]) == 0
    numbers.release([(thing, 2), (thing, 2)], alive=[(thing, 1)])
    assert numbers.state()[1].tolist() == [[thing, 2]]

import torch

from most.structures import Panoptic
from most.viz.agreement import Verdict, compare, segments

CAR, PERSON, ROAD = 1, 2, 3
THINGS = [CAR, PERSON]


def labels(*pairs):
    semantics, ids = torch.tensor(pairs, dtype=torch.int64).reshape(-1, 2).unbind(1)
    return Panoptic(semantics, ids)


def verdicts(truth, prediction):
    return [Verdict(value) for value in compare(truth, prediction, THINGS).verdicts.tolist()]


def test_a_segment_is_a_class_and_an_id():
    found = segments(labels((CAR, 1), (PERSON, 1), (CAR, 1), (ROAD, 7), (CAR, 0)), THINGS).tolist()
    assert found[0] == found[2] != found[1] != 0
    assert found[3:] == [0, 0]


def test_ids_may_be_whole_raw_labels():
    top = (0xFFFF << 16) + 0xFFFF
    assert segments(labels((CAR, top), (PERSON, top - 1)), THINGS).unique().numel() == 2


def test_verdicts_worked_by_hand():
    truth = labels((CAR, 9), (CAR, 9), (CAR, 9), (CAR, 4), (ROAD, 0), (ROAD, 0), (0, 0), (CAR, 0))
    prediction = labels((CAR, 1), (CAR, 1), (CAR, 2), (PERSON, 1), (ROAD, 0), (CAR, 2), (CAR, 1), (CAR, 3))
    # Car 9 is prediction 1: two of three points. The last truth is a car of no instance: any car is right.
    assert verdicts(truth, prediction) == [
        Verdict.RIGHT,
        Verdict.RIGHT,
        Verdict.WRONG_INSTANCE,
        Verdict.WRONG_CLASS,
        Verdict.RIGHT,
        Verdict.WRONG_CLASS,
        Verdict.NOT_SCORED,
        Verdict.RIGHT,
    ]


def test_half_an_instance_is_not_that_instance():
    truth = labels((CAR, 5), (CAR, 5))
    agreement = compare(truth, labels((CAR, 1), (CAR, 2)), THINGS)
    assert agreement.partners == {}
    assert agreement.verdicts.tolist() == [Verdict.WRONG_INSTANCE] * 2


def test_partners_go_from_the_prediction_to_the_truth():
    truth, prediction = labels((CAR, 5), (PERSON, 5), (CAR, 6)), labels((CAR, 1), (PERSON, 2), (CAR, 3))
    partners = compare(truth, prediction, THINGS).partners
    ours, theirs = segments(prediction, THINGS).tolist(), segments(truth, THINGS).tolist()
    assert partners == dict(zip(ours, theirs, strict=True))


def test_no_points_at_all():
    assert verdicts(labels(), labels()) == []

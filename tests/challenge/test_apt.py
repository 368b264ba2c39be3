"""What a stated probability is of: whether the answer as such is true, worked out by hand."""

import pytest

from tissuejax.challenge.grade import calibration, untold
from tissuejax.challenge.verdicts import mark


def marked(truth, verdict, named=(), offered=(), plain=True, category=None, stated=0.9):
    kinds = {0: "none", 1: "one", 2: "two", 3: "three"}
    key = {
        "category": category or kinds[len(truth)],
        "effects": list(truth),
        "plain": {n: plain for n in truth},
        "size_over_noise": {n: 5.0 for n in truth},
        "held_out": "r3",
        "truth_error_over_noise": {"r3": 1.0},
    }
    effects = [{"name": n} for n in named]
    others = [{"effects": [n]} for n in offered]
    return mark("m", key, {"verdict": verdict, "effects": effects, "alternatives": others, "confidence": stated})


@pytest.mark.parametrize(
    ("case", "apt"),
    [
        (((), "nothing-missing"), True),
        ((("slack",), "nothing-missing"), False),
        ((("slack",), "found", ("slack",)), True),
        ((("slack", "aging"), "found", ("slack",)), False),
        ((("slack", "aging"), "found-in-part", ("slack",)), True),
        ((("slack", "aging"), "found-in-part", ("slack", "drift")), False),
        ((("slack",), "found-in-part", ("slack",)), False),
        ((("slack",), "found-in-part", ("slack",), (), False), True),
        (((), "found-in-part", ("slack",)), False),
        ((("slack",), "ambiguous", (), ("drift", "slack")), True),
        ((("slack",), "ambiguous", (), ("drift", "aging")), False),
        ((("slack",), "unexplained"), False),
        ((("spikes",), "unexplained", (), (), True, "unknown"), True),
        ((("spikes",), "found-in-part", ("spikes",), (), True, "unknown"), False),
        ((("slack",), "failed"), False),
    ],
)
def test_an_answer_is_true_or_not_as_such(case, apt):
    assert marked(*case).apt is apt


def test_the_calibration_error_is_of_answers_that_are_true():
    """Two answers of 0.9, one true: off by 0.4; two of 0.6, both true: off by 0.4."""
    some = [
        marked(("slack", "aging"), "found-in-part", ("slack",)),
        marked(("slack",), "unexplained"),
        marked(("slack",), "found", ("slack",), stated=0.6),
        marked((), "nothing-missing", stated=0.6),
    ]
    found = calibration(some)
    assert found["expected_calibration_error"] == pytest.approx(0.4)
    assert found["brier"] == pytest.approx((0.01 + 0.81 + 0.16 + 0.16) / 4)


@pytest.mark.parametrize(
    ("sets", "tried"),
    [
        ([["slack/smooth", "aging"], ["drift"]], True),
        ([["slack"], ["slack", "aging", "drift"]], False),
        ([], False),
        (None, None),
    ],
)
def test_a_truth_that_was_never_tried_is_told_from_one_that_was_not_chosen(sets, tried):
    key = {"category": "two", "effects": ["aging", "slack"], "size_over_noise": {}, "held_out": "r3"} | {
        "truth_error_over_noise": {"r3": 1.0}
    }
    result = {"verdict": "unexplained"} | ({} if sets is None else {"sets": [{"effects": s} for s in sets]})
    m = mark("m", key, result)
    assert m.tried is tried
    rates = untold("pair", [m])
    if tried is not None:
        assert rates["pair: the truth was never tried"]["share"] == (0.0 if tried else 1.0)
        assert rates["pair: the truth was tried and not chosen"]["share"] == (1.0 if tried else 0.0)
    else:
        assert rates["pair: the truth was never tried"]["of"] == 0

"""The panel of real recordings: grading by hand-made answers, the causes file, and what it is graded by."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from tissuejax.challenge.panel import Cause, answered, calibration, confusion, macro_f1, names_f1, read_causes, summary
from tissuejax.errors import InputError

CAUSES = Path(__file__).parents[2] / "fits" / "real-panel" / "causes.toml"
FOAM = Cause(
    "foam",
    "foam",
    False,
    (frozenset({"viscoelasticity", "hysteresis"}), frozenset({"softening"})),
    frozenset({"slack"}),
)
NULL = Cause("rubber", "rubber", True, (), frozenset({"platen-friction"}))


def said(verdict, *names, confidence=0.9):
    return {"verdict": verdict, "effects": [{"name": n} for n in names], "confidence": confidence, "seconds": 3.0}


@pytest.mark.parametrize(
    ("cause", "result", "right", "met", "whole"),
    [
        (FOAM, said("found", "hysteresis"), True, True, False),
        (FOAM, said("found-in-part", "viscoelasticity", "softening"), True, True, True),
        (FOAM, said("found", "viscoelasticity", "slack"), True, True, False),
        (FOAM, said("found", "viscoelasticity", "aging"), False, True, False),
        (FOAM, said("found", "softening"), False, False, False),
        (FOAM, said("ambiguous", "viscoelasticity"), True, True, False),
        (FOAM, said("unexplained", "viscoelasticity"), False, False, False),
        (FOAM, said("nothing-missing"), False, False, False),
        (NULL, said("nothing-missing"), True, False, False),
        (NULL, said("unexplained"), True, False, False),
        (NULL, said("found-in-part", "platen-friction"), True, False, False),
        (NULL, said("found", "energy-form"), True, False, False),
        (NULL, said("found", "slack"), False, False, False),
        (NULL, said("failed"), False, False, False),
    ],
)
def test_an_answer_is_held_against_its_cause(cause, result, right, met, whole):
    a = answered(cause, result)
    assert (a.right, a.met, a.whole) == (right, met, whole)


def test_form_of_the_energy_is_a_wrong_name_where_there_is_a_cause_and_it_is_not_allowed():
    assert answered(FOAM, said("found", "viscoelasticity", "energy-form")).wrong == ("energy-form",)


def test_a_name_of_the_catalogue_counts_under_the_word_of_the_file():
    liver = Cause("liver", "liver", False, (frozenset({"specimen-scatter"}),), frozenset())
    assert answered(liver, said("found", "scatter"), {"scatter": "specimen-scatter"}).right
    assert not answered(liver, said("found", "scatter")).right


def test_rates_confusion_and_macro_f1_by_hand():
    answers = [
        answered(FOAM, said("found", "hysteresis")),
        answered(FOAM, said("found", "aging")),
        answered(FOAM, said("unexplained", confidence=0.2)),
        answered(NULL, said("nothing-missing")),
        answered(NULL, said("found", "slack", confidence=0.6)),
    ]
    cause = "hysteresis or viscoelasticity"
    assert confusion(answers) == {
        cause: {cause: 1, "aging": 1, "unexplained": 1},
        "nothing": {"nothing": 1, "slack": 1},
    }
    # F1 of the cause 2/(2+0+2) = 1/2, of nothing 2/(2+0+1) = 2/3
    assert macro_f1(confusion(answers)) == pytest.approx((1 / 2 + 2 / 3) / 2)
    found = summary(answers)
    assert found["rates"]["cause named and no wrong name"]["share"] == pytest.approx(1 / 3)
    assert found["rates"]["nulls: a wrong physical name"]["share"] == pytest.approx(1 / 2)
    # bins: 0.2 wrong (error 0.2), 0.6 wrong (0.6), three at 0.9 of which two right (0.2333)
    error = (0.2 + 0.6 + 3 * abs(0.9 - 2 / 3)) / 5
    assert calibration(answers)["expected_calibration_error"] == pytest.approx(error)
    assert math.isclose(found["calibration"]["brier"], (0.04 + 0.36 + 0.01 + 0.81 + 0.01) / 5)


def test_the_causes_file_holds_what_was_promised():
    causes, words = read_causes(CAUSES)
    assert sum(not c.null for c in causes) >= 40
    assert sum(c.null for c in causes) >= 15
    assert words["scatter"] == "specimen-scatter"


def test_a_null_that_expects_a_cause_is_refused(tmp_path):
    path = tmp_path / "causes.toml"
    path.write_text(
        '[[protocol]]\nkey = "x"\nnull = true\nexpected = [["slack"]]\nbeside = []\n'
        'specimens = [{ id = "a", tests = [] }]\n'
    )
    with pytest.raises(InputError, match="a null expects nothing"):
        read_causes(path)


def test_by_verdict_and_by_chance():
    """One answer that states p misses by |p - 1| or p: on average 2 p (1 - p) if it is true as often as it says."""
    made = SimpleNamespace(verdict="found", confidence=0.8, apt=True)
    other = SimpleNamespace(verdict="unexplained", confidence=0.6, apt=False)
    found = calibration([made, other])
    assert set(found["by_verdict"]) == {"found", "unexplained"}
    own = found["by_verdict"]["found"]
    assert (own["of"], own["share"], own["stated"]) == (1, 1.0, 0.8)
    assert own["expected_calibration_error"] == pytest.approx(0.2)
    assert own["error_by_chance"] == pytest.approx(2 * 0.8 * 0.2, abs=0.03)
    assert found["expected_calibration_error"] == pytest.approx((0.2 + 0.6) / 2)


def test_a_second_name_counts_against_the_cause_that_it_is():
    """Two samples: a is named alone (one right, one false from the other), b with a wrong a beside it."""
    causes = {n: Cause(n, n, False, (frozenset({n}),), frozenset()) for n in ("a", "b")}
    alone = answered(causes["a"], {"verdict": "found", "effects": [{"name": "a"}]})
    both = answered(causes["b"], {"verdict": "found", "effects": [{"name": "b"}, {"name": "a"}]})
    assert names_f1([alone, both]) == pytest.approx((2 / 3 + 1) / 2)
    assert names_f1([alone]) == 1.0

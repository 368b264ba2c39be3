"""Every number of a judgement stands in a record with unit, meaning and ground; what stands loose only rounds."""

import ast
import dataclasses
import inspect
import re

import pytest

import tissuejax
from tests.house.test_house import ROOT
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.numbers import Numbers, numbers_of
from tissuejax.diagnosis.judgement.particular import Means, Shown, Simulated, Strokes
from tissuejax.estimation.smoothness import Smoothness

RECORDS = (Criteria, Course, Effort, Means, Shown, Simulated, Smoothness, Strokes)
ROOMS = [
    *sorted((ROOT / "diagnosis" / "judgement").glob("*.py")),
    *(ROOT / "diagnosis" / f"{name}.py" for name in ("offered", "starts", "probing_view", "probing_slopes")),
    *(ROOT / "diagnosis" / f"{name}.py" for name in ("probing_discrepancy", "cutting_discrepancy")),
    *(ROOT / "estimation" / f"{name}.py" for name in ("discrepancy", "sudden", "smoothness")),
]
# Numbers of formulas: counts of two or less, halves.
FORMULA = (0, 1, 2, 0.5)
# What rounds, or where an iteration or a quadrature inside a formula ends: by file, as it stands there, and why.
ROUNDING = {
    "answer.py": {},
    "discrepancy.py": {1e-5: "eigenvalues that are cut off"},
    "explore.py": {3: "the first three of a tuple"},
    "judge.py": {10: "alternatives that are listed; the posterior has them all"},
    "marginal.py": {
        10.0: "default of `Widths.factor`, where no part is wider; and as far as an amplitude is followed",
        15: "steps of Newton's method", 6: "its shortened steps", 4: "by which they are shortened",
        0.02: "nats where it ends; least curvature of parts that are alike",
    },
    "mass.py": {
        1e-4: "least amplitude of the quadrature", 10.0: "its largest", 500: "its points", 1e-3: "of no determinant",
        0.03: "knots", 0.1: "knots", 0.3: "knots", 3.0: "knots", 100.0: "knots", 4: "knots", 8: "knots", 16: "knots",
        15.0: "nats: what lies beyond is nothing", 0.02: "least standard error of knots", 1.5: "its largest",
    },
    "offered.py": {6: "digits of a direction", 0.3: "width", 0.15: "width"},
    "blocks.py": {3: "time, strain and stress, each a third of a block's way"},
    "rest.py": {4: "of the variance of a square"},
    "starts.py": {30: "scales that a linear step may go", 0.9: "of a step to its bound", 0.1: "the rest of it"},
    "numbers.py": {0.99: "the largest share that is tried"},
    "reweigh.py": {12.0: "nats of weight: what no number brings to the top", 25: "sets at most: cost"},
    "sudden.py": {0.01: "quadrature", 4.0: "quadrature", 30: "its points"},
    "weigh.py": {1e3: "of the peak: a prediction gone wild"},
    "cutting_discrepancy.py": {0.15: "width"},
}  # fmt: skip


def loose(tree: ast.AST) -> list[tuple[int, float]]:
    """Line and value of numbers outside a record's fields that are none of a formula and no rounding by their size."""
    names = {r.__name__ for r in RECORDS}
    inside = {id(n) for c in ast.walk(tree) if isinstance(c, ast.ClassDef) and c.name in names for s in c.body
              if isinstance(s, ast.AnnAssign) for n in ast.walk(s)}  # fmt: skip
    return [
        (n.lineno, n.value)
        for n in ast.walk(tree)
        if isinstance(n, ast.Constant)
        and isinstance(n.value, int | float)
        and not isinstance(n.value, bool)
        and id(n) not in inside
        and n.value not in FORMULA
        and not 0 < n.value <= 1e-6
    ]


@pytest.mark.parametrize("path", ROOMS, ids=lambda p: p.name)
def test_no_number_of_a_judgement_stands_loose(path):
    known = {} if path.parent.name == "estimation" and path.name == "sudden.py" else ROUNDING.get(path.name, {})
    found = loose(ast.parse(path.read_text()))
    stray = [f"{path.name}:{line}: {value:g}" for line, value in found if value not in known]
    assert not stray, f"make it a field of a record ({', '.join(r.__name__ for r in RECORDS)}), or say why it rounds"
    assert set(known) <= {value for _, value in found}, "these are no longer there"


def test_the_test_sees_a_loose_number():
    source = "NEAR = 8.0\nclass Effort:\n    most: int = 3\ndef f(x, far=20):\n    return 0.5 * x > 7 + 1e-9\n"
    assert sorted(value for _, value in loose(ast.parse(source))) == [7, 8.0, 20]


@pytest.mark.parametrize("record", RECORDS)
def test_a_record_says_meaning_and_ground_of_each_field(record):
    text = inspect.getdoc(record).partition("Attributes:")[2]
    starts = list(re.finditer(r"^    ((?:\w+, )*\w+): ", text, re.M))
    said = {
        name: text[m.end() : after.start()]
        for m, after in zip(starts, [*starts[1:], re.search(r"\Z", text)], strict=True)
        for name in m.group(1).split(", ")
    }
    assert record.__dataclass_params__.frozen
    fields = {f.name: getattr(record(), f.name) for f in dataclasses.fields(record)}
    assert set(said) == set(fields)
    counted = {path.split(".")[0] for path in numbers_of(record())}
    bare = [n for n, x in fields.items() if n in counted and not isinstance(x, RECORDS) and "Ground:" not in said[n]]
    assert not bare, f"{record.__name__}: without a ground"


def test_all_numbers_are_reached_from_one_place_and_each_can_be_changed():
    known = Numbers().all()
    assert {"criteria.shares.law", "criteria.smooth.slow.quick", "effort.hopeful", "effort.course.rounds"} <= set(known)
    for path in known:
        other = Numbers().changed(path, 2.0).all()
        assert {p for p in known if other[p] != known[p]} <= {path}
    assert Numbers().changed("criteria.smooth.turning", 2.0).criteria.smooth.turning == 0.8
    assert Numbers().changed("effort.rounds", 0.5).effort.rounds == 2
    with pytest.raises(tissuejax.errors.InputError, match="criteria.shares.law"):
        Numbers().changed("criteria.shares.lw", 2.0)


def test_the_page_lists_the_records():
    page = (ROOT.parent / "docs" / "judgement.md").read_text()
    assert not [r.__name__ for r in RECORDS if f"`{r.__name__}`" not in page]

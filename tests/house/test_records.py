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
    *(
        ROOT / "diagnosis" / f"{name}.py"
        for name in ("offered", "probing_offered", "starts", "probing_view", "probing_slopes")
    ),
    *(ROOT / "diagnosis" / f"{name}.py" for name in ("probing_discrepancy", "cutting_discrepancy")),
    *(ROOT / "estimation" / f"{name}.py" for name in ("discrepancy", "sudden", "smoothness")),
]
# Numbers of formulas inside functions: counts of two or less, halves. Of constants and defaults none is left out but 0.
FORMULA = (0, 1, 2, 0.5)
# What rounds, and where an iteration or a quadrature inside a formula ends: by file, the name it has or the function it
# stands in, its value, and why.
ROUNDING = {
    "estimation/sudden.py": {"stiffness 3": "degree of a curve through a series, for its slope"},
    "estimation/discrepancy.py": {"LEFT_OUT 1e-05": "eigenvalues that are cut off"},
    "judgement/blocks.py": {"blocks 3": "time, strain and stress, each a third of a block's way"},
    "judgement/nominate.py": {"nominated 3": "the first three of a tuple"},
    "judgement/judge.py": {"judge 10": "alternatives that are listed; the posterior has them all"},
    "judgement/marginal.py": {
        "factor 10": "default of `Widths.factor`, where no part is wider",
        "amplitudes 10": "as far as an amplitude is followed, in its widest widths",
        "amplitudes 15": "steps of Newton's method", "amplitudes 6": "its shortened steps",
        "amplitudes 4": "by which they are shortened", "amplitudes 0.02": "nats where it ends; least curvature",
    },
    "judgement/mass.py": {
        "LEAST TEN POINTS 0.0001": "of the quadrature", "LEAST TEN POINTS 10": "of it", "LEAST TEN POINTS 500": "of it",
        **{f"KNOTS {x:g}": "of an interpolation" for x in (0.03, 0.1, 0.3, 3.0, 10.0, 100.0)},
        "KNOTS 1": "of an interpolation",
        **{f"AROUND {x:g}": "of an interpolation" for x in (0.5, 1, 2, 4, 8, 16)},
        "FALLEN 15": "nats: what lies beyond is nothing", "MOVED 0.001": "above rounding",
        "amplitude_mass 0.001": "on the diagonal of a matrix", "_within 0.02": "least error between knots",
        "_within 1.5": "its largest",
    },
    "judgement/ranges.py": {"DRAWN 500": "points of a cubature, by dimension"},
    "judgement/numbers.py": {"changed 0.99": "the largest share that is tried"},
    "judgement/rest.py": {"wobble 4": "of the variance of a square", "SLICES 200": "of a quadrature"},
    "judgement/reweigh.py": {"of 12": "nats of weight that no number brings to the top", "of 25": "sets at most: cost"},
    "judgement/sudden.py": {f"AMPLITUDES {x:g}": "of the quadrature" for x in (0.01, 4.0, 30)},
    "judgement/weigh.py": {"WILD 1000": "of the peak: a prediction gone wild", "kurtosis 3": "that of a normal one"},
    "diagnosis/offered.py": {"direction 6": "digits of a direction"},
    "diagnosis/starts.py": {
        "inside 30": "scales that a linear step may go", "inside 0.9": "of a step to a bound", "inside 0.1": "its rest",
    },
}  # fmt: skip


def loose(tree: ast.AST) -> list[str]:
    """Numbers outside a record's fields that are none of a formula and no rounding by their size: where, and which.

    "Where" is the innermost function, or the names that are assigned outside of any.
    """
    records, found = {r.__name__ for r in RECORDS}, []

    def walk(node: ast.AST, where: str, formula: tuple[float, ...]) -> None:
        if isinstance(node, ast.ClassDef) and node.name in records:
            return
        if isinstance(node, ast.FunctionDef):
            where = node.name
            for default in (*node.args.defaults, *filter(None, node.args.kw_defaults)):
                walk(default, where, (0,))
            for statement in (*node.decorator_list, *node.body):
                walk(statement, where, FORMULA)
            return
        if isinstance(node, ast.Assign | ast.AnnAssign) and formula != FORMULA:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            where = " ".join(n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            rounds = node.value in formula or 0 < node.value <= 1e-6
            found.extend([] if rounds else [f"{where} {node.value:g}"])
        for child in ast.iter_child_nodes(node):
            walk(child, where, formula)

    walk(tree, "", (0,))
    return found


@pytest.mark.parametrize("path", ROOMS, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_no_number_of_a_judgement_stands_loose(path):
    known = ROUNDING.get(f"{path.parent.name}/{path.name}", {})
    found = set(loose(ast.parse(path.read_text())))
    stray = sorted(found - set(known))
    assert not stray, f"make it a field of a record ({', '.join(r.__name__ for r in RECORDS)}), or say why it rounds"
    assert set(known) <= found, "these are no longer there"


def test_the_test_sees_a_loose_number():
    source = """
NEAR = 8.0
class Effort:
    most: int = 3
class Other:
    most: int = 4
def f(x, far=20, *, half=0.5):
    return 0.5 * x > 7 + 1e-9
TWICE = 2
"""
    assert sorted(loose(ast.parse(source))) == ["NEAR 8", "TWICE 2", "f 0.5", "f 20", "f 7", "most 4"]


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
    assert Numbers().changed("effort.course.rounds", 0.5).effort.course.rounds == 2
    with pytest.raises(tissuejax.errors.InputError, match="criteria.shares.law"):
        Numbers().changed("criteria.shares.lw", 2.0)


def test_the_page_lists_the_records():
    page = (ROOT.parent / "docs" / "judgement.md").read_text()
    assert not [r.__name__ for r in RECORDS if f"`{r.__name__}`" not in page]

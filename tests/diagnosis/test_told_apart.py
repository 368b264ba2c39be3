"""Which sets can't be told apart: near by the criterion, or ahead by nothing but values of the held-out recordings."""

from types import SimpleNamespace

import pytest

from tissuejax.diagnosis.decide import rivals_with


@pytest.mark.parametrize(
    ("dear", "own", "criterion", "fitted", "answer"),
    [
        (True, {}, 105.0, 60.0, True),  # as near as the data can tell
        (True, {}, 300.0, 40.0, False),
        (True, {"depth.r3": 1e-4}, 300.0, 40.0, True),  # better where both were fitted
        (True, {"depth.r3": 1e-4}, 300.0, 60.0, False),
        (False, {"offset.b": 1.0}, 300.0, 40.0, False),
    ],
)
def test_a_lead_that_rests_on_values_of_the_held_out_probings_settles_nothing(dear, own, criterion, fitted, answer):
    chosen = SimpleNamespace(keys=("a",), own=own, criterion=100.0, fitted=50.0)
    other = SimpleNamespace(keys=("b",), own={}, criterion=criterion, fitted=fitted)
    assert rivals_with(search(dear, {(): 200.0}), chosen, other) is answer


@pytest.mark.parametrize(("beside", "answer"), [(1100.0, False), (5100.0, True)])
def test_a_second_name_is_measured_by_what_the_first_one_left(beside, answer):
    """Two second names 45 apart: little against the 100,000 that the first one explained, much against 1,000 left."""
    chosen = SimpleNamespace(keys=("a", "b"), own={}, criterion=100.0)
    other = SimpleNamespace(keys=("a", "c"), own={}, criterion=145.0)
    assert rivals_with(search(True, {(): 100_000.0, ("a",): beside}), chosen, other) is answer


def search(dear: bool, criteria: dict[tuple, float]):
    refits = {frozenset(k): SimpleNamespace(keys=k, criterion=c) for k, c in criteria.items()}
    return SimpleNamespace(
        bench=SimpleNamespace(dear=dear),
        refits=refits,
        empty=refits[frozenset()],
        names=lambda keys: frozenset(keys),
        criterion=lambda r: r.criterion,
        fitted=lambda r: r.fitted,
    )

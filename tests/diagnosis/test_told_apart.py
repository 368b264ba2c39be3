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
    chosen = SimpleNamespace(own=own, criterion=100.0, fitted=50.0)
    other = SimpleNamespace(own={}, criterion=criterion, fitted=fitted)
    s = SimpleNamespace(
        bench=SimpleNamespace(dear=dear),
        criterion=lambda r: r.criterion,
        fitted=lambda r: r.fitted,
        empty=SimpleNamespace(criterion=200.0),
    )
    assert rivals_with(s, chosen, other) is answer

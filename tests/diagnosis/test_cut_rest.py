"""What a diagnosis of cuts may leave unexplained without a name."""

import numpy as np

from tissuejax.diagnosis.cutting import CutDiscrepancy
from tissuejax.estimation.discrepancy import Series, discrepancy, loading_states


def test_the_rest_of_a_cut_is_no_function_of_place():
    """Two strokes over the same way: no part makes their errors alike at one place, as toughness along it would."""
    time, x = np.linspace(0, 10, 30), np.linspace(0, 0.03, 30)
    strokes = [Series(n, "force", time, x[:, None], loading_states(x), 1.0) for n in ("slow", "fast")]
    general = discrepancy(strokes, np.full(60, 0.01))
    parts = CutDiscrepancy.of(general).about(np.ones(60))
    assert [p.name for p in parts] == ["gain", "quick", "slow", "lasting", "white"]
    shared = lambda p: 0.0 if p.factor is None else np.abs(p.factor[:30] @ p.factor[30:].T).max()  # noqa: E731
    assert max(map(shared, parts)) == 0.0
    assert max(map(shared, general.about(np.ones(60)))) > 0.5, "the parts of material tests do"

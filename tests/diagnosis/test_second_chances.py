"""Sets that deserve a second look: needed though the held-out recording is blind to them, or of the wrong form."""

from dataclasses import replace

import numpy as np
import pytest
from spring_bench import spring

from tissuejax.diagnosis.decide import needed
from tissuejax.diagnosis.search import Budget, promising, search


@pytest.fixture(scope="module")
def found():
    return search(spring({"form.c": 8.0, "relax.g": 0.2, "relax.tau": 0.6}), Budget(most=1))


@pytest.mark.parametrize(
    ("left", "held", "answer"),
    [(1.0, 1.01, True), (3.0, 1.01, False), (1.0, 1.6, False)],
    ids=["leaves noise", "leaves a third of it", "speaks against it"],
)
def test_a_held_out_recording_that_is_noise_either_way_has_no_say(found, left, held, answer):
    """Chi-square per sample 60 -> 7 -> `left`, a tenth of it all, and held out 1 -> 1 -> `held`."""
    s, kept = found, dict(found.refits)
    base, n, n_held = s.empty, s.empty.n, s.empty.n_held
    try:
        s.refits[frozenset()] = replace(base, chi2=60.0 * n, held=1.0 * n_held)
        smaller = replace(s.refits[frozenset({"form"})], chi2=7.0 * n, held=1.0 * n_held)
        both = {**smaller.values, **s.refits[frozenset({"relax"})].values}
        larger = replace(smaller, keys=("form", "relax"), values=both, chi2=left * n, held=held * n_held)
        assert needed(s, larger, smaller) == answer
    finally:
        s.refits.update(kept)


def test_a_law_that_ran_away_is_tried_in_its_other_forms_where_it_explains_more_than_those_believed(found):
    s, key = found, frozenset({"form"})
    path, before = "form.c", dict(found.bench.free)
    try:
        s.bench.free = before | {path: replace(before[path], upper=9.0, limited=True)}
        good = s.refits[key]
        best = min(r.chi2 for k, r in s.refits.items() if len(k) == 1)
        runaway = replace(good, chi2=best / 2, held=0.0, values={**good.values, path: 9.0}, at_bound=(path,))
        s.refits[key] = runaway
        s.refits = {k: r for k, r in s.refits.items() if len(k) < 2}
        assert s.doubts(key)
        assert key in promising(s, 2)
        s.refits[key] = replace(runaway, chi2=np.inf, held=np.inf)
        assert key not in promising(s, 2), "it explains nothing"
    finally:
        s.bench.free = before

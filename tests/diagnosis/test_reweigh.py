"""Sets weighed again from where a search left them: the same numbers, the same weights; others, what algebra says."""

import copy
import json
import math

import pytest
from spring_bench import spring

from tissuejax.diagnosis.judgement.answer import answer
from tissuejax.diagnosis.judgement.blocks import blocks, driven_states, series
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.judge import judge
from tissuejax.diagnosis.judgement.numbers import Numbers
from tissuejax.diagnosis.judgement.reweigh import Found, Rested, reweighed
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.errors import InputError
from tissuejax.estimation.discrepancy import discrepancy


@pytest.fixture(scope="module")
def searched():
    """A spring that relaxes, searched: its bench, block means, discrepancy and answer."""
    bench = spring({"relax.g": 0.2, "relax.tau": 0.6})
    whole = copy.copy(bench)
    whole.fitted, whole.held_out = (*bench.fitted, *bench.held_out), ()
    cut = blocks(whole)
    of = discrepancy(series(whole, cut, driven_states(whole)), cut.spread(whole.sigma))
    return whole, cut, of, answer(bench, whole, cut, of, Setup(effort=Effort(most=1, singles=4, reshaped=(0, 0, 0))))


def by_keys(evidence):
    return {s.keys: s.log_evidence for s in evidence.sets}


def test_the_same_numbers_weigh_as_the_search_did(searched):
    whole, cut, of, found = searched
    stored = Found.read(json.loads(json.dumps(Found.of(found.exploration, ("r3",)).as_dict())))
    again = reweighed(whole, cut, of, stored, Criteria())
    before, after = by_keys(found.evidence), by_keys(again)
    settled = found.exploration.effort.course.settled
    assert len(after) == len(stored.sets) > 1
    assert {k: before[k] for k in after} == pytest.approx(after, abs=2 * settled)
    assert judge(again).kind == found.kind
    assert judge(again).confidence == pytest.approx(found.confidence, abs=0.01)
    assert (again.fitted, again.held_out) == (("r1", "r2"), ("r3",))


def test_an_effect_half_as_large_beforehand_weighs_what_its_prior_says(searched):
    """The amplitude's prior is normal about none with a width s in proportion to `change`, and data say all of the
    amplitude a: the evidence goes by the prior's density at a, exp(-a^2 / 2 s^2) / s. Its base knows nothing of it."""
    whole, cut, of, found = searched
    weighed, scales = found.exploration.weighed, found.exploration.scales
    best = weighed[frozenset({"relax"})]
    stored = Found((Rested.of(weighed[frozenset()]), Rested.of(best)))
    said = {}
    for factor in (1.0, 0.5):
        criteria = Numbers().changed("criteria.change", factor).criteria
        said[factor] = by_keys(reweighed(whole, cut, of, stored, criteria))
    # half as wide: log 2 for the height, and four times the square
    # half as wide: twice as high, and four times the square
    a = best.refit.values["relax.g"]
    s = scales.effect_size(whole.candidates["relax"], best.begun, Criteria())["relax.g"]
    expected = math.log(2.0) - 0.5 * (a / s) ** 2 * (4.0 - 1.0)
    assert said[0.5][("relax",)] - said[1.0][("relax",)] == pytest.approx(expected, abs=0.1)
    assert said[0.5][()] == pytest.approx(said[1.0][()], abs=1e-6)


def test_a_set_that_is_not_offered_is_refused(searched):
    whole, cut, of, found = searched
    stored = Found.of(found.exploration)
    stranger = Found((*stored.sets, Rested(("magnetism",), {}, (), {})))
    with pytest.raises(InputError, match="magnetism"):
        reweighed(whole, cut, of, stranger, Criteria())

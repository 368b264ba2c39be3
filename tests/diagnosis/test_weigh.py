"""Sets whose model does nothing, or can't be predicted, are void: no verdict rests on them and nothing stops."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal
from spring_bench import FREE, START, Spring, judged, spring

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.diagnosis.judgement.blocks import blocks, driven_states, series
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.scales import scaled
from tissuejax.diagnosis.judgement.weigh import Start, weigh
from tissuejax.diagnosis.locate import locate
from tissuejax.estimation.discrepancy import discrepancy

FIBRES = Candidate("fibres", ("fibre.k",), ("fibre.onset",), ({"fibre.onset": 5.0},))
MORE = {"fibre.k": Free(0, np.inf, 10), "fibre.onset": Free(0.01, 100, 1, log=True), "base.k": Free(0, np.inf, 1)}


class Fibred(Spring):
    """The spring with fibres that bear beyond `onset`, and a parameter of the base that does nothing in these tests."""

    most, beyond = np.inf, np.inf

    def predict(self, values, recordings=None):
        v = {**self.start, **dict(values)}
        x = np.concatenate([s.drive for s in self.segments])
        added = v["fibre.k"] * np.maximum(x - v["fibre.onset"], 0.0)
        bad = np.where(v["form.c"] > self.most, self.beyond, 0.0)
        return super().predict(values) + added + v["base.k"] * np.maximum(x - 2, 0) + bad


@pytest.fixture
def bench():
    made = spring({"relax.g": 0.3}, sigma=0.02, held_out=())
    return Fibred(
        [replace(s, drive_name="shear") for s in made.segments],
        made.y,
        made.sigma,
        made.fitted,
        (),
        made.base,
        FREE | MORE,
        START | {"fibre.k": 0.0, "fibre.onset": 5.0, "base.k": 1.0},
        {**made.candidates, "fibres": FIBRES},
    )


def scales(bench):
    cut, start = blocks(bench), {p: bench.start[p] for p in bench.base}
    of = discrepancy(series(bench, cut, driven_states(bench)), cut.spread(bench.sigma))
    out = scaled(bench, cut, of, bench.y, start)
    base = weigh(out, (), Start(start), Criteria())
    out.values, out.reference = base.refit.values, cut.mean(base.refit.prediction)
    return out, base


def test_fibres_that_nothing_stretches_are_void(bench):
    on, base = scales(bench)
    found = weigh(on, ("fibres",), Start({**base.refit.values, "fibre.k": 12.0}), Criteria())
    assert found.evidence.void
    assert np.isfinite(found.evidence.log_evidence)
    # all that they add is a prior that the data say nothing of: its mass is one, and the evidence is the base's
    assert found.evidence.log_evidence == pytest.approx(base.evidence.log_evidence, abs=0.1)


def test_where_fibres_bear_at_a_shape_scanned_they_have_the_size_of_that(bench):
    bench.candidates["fibres"] = replace(FIBRES, grid=({"fibre.onset": 0.1},))
    on, _ = scales(bench)
    at = on.effect_size(bench.candidates["fibres"], {"fibre.onset": 5.0}, Criteria())
    assert at == on.effect_size(bench.candidates["fibres"], {"fibre.onset": 0.1}, Criteria())


def test_how_large_an_effect_may_be_goes_by_its_shape_where_the_fit_rests(bench):
    """Fibres that bear from the start do three times as much, for one stiffness, as fibres that bear late."""
    on, base = scales(bench)
    early, late = (on.effect_size(FIBRES, {"fibre.onset": x}, Criteria())["fibre.k"] for x in (0.01, 0.6))
    assert late > 3 * early
    at = {**base.refit.values, "fibre.k": 3.0, "fibre.onset": 0.3}
    starts = [Start({**at, "fibre.onset": x}, at=at) for x in (0.01, 0.3, 0.6)]
    still = Course(rounds=1, iterations=0)
    found = [weigh(on, ("fibres",), s, Criteria(), still).evidence.log_evidence for s in starts]
    assert found == pytest.approx([found[1]] * 3, abs=1e-6)


def test_a_parameter_of_the_base_that_does_nothing_is_left_alone(bench):
    _, base = scales(bench)
    bench.base = (*bench.base, "base.k")
    _, more = scales(bench)
    assert more.evidence.log_evidence == pytest.approx(base.evidence.log_evidence, abs=0.1)
    assert more.refit.values["base.k"] == 1.0


@pytest.mark.parametrize("beyond", [np.inf, 1e9])
def test_a_set_that_can_not_be_predicted_is_void_and_not_ranked(bench, beyond):
    bench.beyond = beyond
    on, base = scales(bench)
    bench.most = -1.0
    found = weigh(on, ("form",), Start(base.refit.values), Criteria())
    assert found.evidence.void
    assert found.evidence.log_evidence == -np.inf
    e = Exploration(bench, Criteria(), Effort(), on)
    e.weighed = {frozenset(): base, frozenset({"form"}): found}
    assert e.ranked(1) == []
    assert e.best == frozenset()


def test_sets_that_may_still_come_to_the_top_are_those_near_it(bench):
    """Evidence made up: 8 nats below the best is as far as another form may bring a set up."""
    on, base = scales(bench)
    e = Exploration(bench, Criteria(), Effort(), on)
    e.weighed = {frozenset(): base}
    for name, above in (("relax", 30.0), ("offset", 26.0), ("form", 5.0)):
        said = replace(base.evidence, keys=(name,), names=(name,), log_evidence=base.evidence.log_evidence + above)
        e.weighed[frozenset({name})] = replace(base, evidence=said)
    relax, offset, form = (frozenset({k}) for k in ("relax", "offset", "form"))
    assert e.best == relax
    assert e.ranked(1) == [relax, offset, form]
    assert e.near(1) == [relax, offset]


def test_the_share_explained_is_none_for_the_base_and_nearly_all_for_the_truth(bench):
    on, base = scales(bench)
    again = weigh(on, (), Start(base.refit.values), Criteria())
    assert again.evidence.explained == pytest.approx(0.0, abs=0.05)
    found = weigh(on, ("relax",), Start(base.refit.values | {"relax.g": 0.2}), Criteria())
    assert 0.95 < found.evidence.explained <= 1.0


@pytest.mark.parametrize("iterations", [1, 12])
def test_the_density_is_that_of_the_parameters_reached(bench, iterations):
    """Not of those that a straight line leads to from there: the discrepancy moves with what they predict."""
    on, _ = scales(bench)
    found = weigh(on, (), Start({"a": 60.0, "b": -20.0}), Criteria(), Course(rounds=1, iterations=iterations))
    left = on.cut.mean(bench.y - found.refit.prediction)
    covariance = block_diag(*on.blocked.within(found.parts, found.v))
    for part, v in zip(found.parts, found.v, strict=True):
        if part.factor is not None:
            covariance += v * part.factor @ part.factor.T
    expected = multivariate_normal.logpdf(left, cov=covariance, allow_singular=True)
    assert found.evidence.fit == pytest.approx(expected, abs=0.05)


class Twofold(Fibred):
    """A cheap spring whose fine simulation breaks down where it is stiffer than `LAST`, as laws that soften do."""

    last, broken = 12.0, False

    def anchored(self, values):
        made = copy.copy(self)
        made.broken = values["b"] > self.last
        return made

    def predict(self, values, recordings=None):
        return super().predict(values) * (np.nan if self.broken else 1.0)


def test_where_the_fine_simulation_breaks_down_a_fit_stays_short_of_that(bench):
    bench.__class__ = Twofold
    _, base = scales(bench)
    assert np.isfinite(base.evidence.log_evidence)
    assert 6.0 < base.refit.values["b"] <= 12.0  # of 20 that describe the recordings best
    assert np.all(np.isfinite(base.refit.prediction))


class Retaken(Spring):
    """The same without fibres, which takes its correction from where a set was weighed."""

    last, broken = 12.0, False
    anchored, predict = Twofold.anchored, lambda self, *a: Spring.predict(self, *a) * (np.nan if self.broken else 1.0)

    def corrected_as(self, other):
        made = copy.copy(self)
        made.broken = other.broken
        return made


def test_nor_does_what_is_shown_come_from_a_simulation_that_broke_down():
    """The least-squares fit of the base, which is shown, lies where no fine simulation runs."""
    sample = spring({})
    sample.__class__ = Retaken
    answer = judged(sample, Effort(most=1))
    for fit in (answer.empty, answer.chosen):
        assert np.all(np.isfinite(fit.prediction))
        assert np.isfinite(fit.chi2)
    assert all(np.isfinite(x.share) for x in locate(answer.bench, answer.empty.prediction))

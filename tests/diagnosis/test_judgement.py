"""The judgement: evidence against dense linear algebra, and a verdict that is arithmetic on plain numbers."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.stats import halfnorm, multivariate_normal
from weighed_sets import evidence, weighed

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import read_evidence, write_evidence
from tissuejax.diagnosis.judgement.judge import Beforehand, Kind, judge
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Widths, amplitudes, factored, marginal
from tissuejax.diagnosis.judgement.mass import amplitude_mass
from tissuejax.estimation.discrepancy import Part, Series, discrepancy, loading_states
from tissuejax.estimation.smoothness import USUAL


@pytest.mark.parametrize("seed", range(30))
def test_no_other_verdict_has_a_larger_stated_probability(seed):
    rng = np.random.default_rng(seed)
    sets = [weighed(n, rng.normal(0, 4), 10 ** rng.uniform(-7, -2)) for n in ([], ["relaxation"], ["slack"], ["drift"])]
    sets += [weighed(["relaxation", "slack"], rng.normal(0, 4))]
    j = judge(evidence(*sets))
    assert j.confidence == max(j.probabilities.values())
    assert sum(j.probabilities.values()) == pytest.approx(1.0)
    assert all(0 <= p <= 1 for p in (*j.probabilities.values(), *j.inclusion.values()))


def test_probabilities_by_hand():
    """Odds are prior odds times the ratio of evidences to a power (of 100 data: a half); slack has a third of 0.4."""
    j = judge(evidence(weighed([], 0.0), weighed(["slack"], math.log(1000.0))), Criteria(coarse=100.0))
    odds = math.sqrt(1000.0) * (0.4 / 3) / 0.4
    assert j.inclusion["slack"] == pytest.approx(odds / (1 + odds))
    assert j.kind is Kind.FOUND
    assert j.names == ("slack",)


def test_a_fault_of_a_test_machine_is_rarer_by_hand():
    """Of 0.4 for one effect it has 0.1 / 2.1, of 0.15 for two a pair with it 0.1 / 1.2."""
    sets = evidence(weighed([], 0.0), weighed(["slack"], 3.0), weighed(["slack", "drift"], 2.0))
    sets = dataclasses.replace(sets, faults=("slack",))
    j = judge(sets, Criteria(fault=0.1, coarse=1e12))
    likely = np.array([0.4, 0.4 * 0.1 / 2.1 * math.exp(3.0), 0.15 * 0.1 / 1.2 / 3 * math.exp(2.0)])
    likely /= likely.sum()
    assert j.posterior[""] == pytest.approx(likely[0])
    assert j.inclusion["slack"] == pytest.approx(likely[1] + likely[2])
    assert j.inclusion["drift"] == pytest.approx(likely[2])


@pytest.mark.parametrize("fault", [0.1, 1.0])
def test_what_is_held_for_probable_adds_up(fault):
    """Over all sets that may act, and over those that hold an effect, whatever their odds."""
    forms = dict.fromkeys("abcde", 1)
    before = Beforehand.of(forms, ("b", "d"), Criteria(fault=fault))
    every = [s for k in range(6) for s in itertools.combinations(forms, k)]
    assert sum(before.exactly(s) for s in every) == pytest.approx(1.0)
    for some in (("a",), ("b",), ("a", "d"), ()):
        assert before.with_all(some) == pytest.approx(sum(before.exactly(s) for s in every if set(some) <= set(s)))
    assert before.exactly(("a",)) * fault == pytest.approx(before.exactly(("b",)))
    few = Beforehand.of({"a": 1}, (), Criteria())
    assert few.exactly(()) + few.exactly(("a",)) == pytest.approx(1.0)


def test_more_data_of_a_model_that_is_nearly_right_count_less_each_but_never_less_in_all():
    n = np.arange(1, 5000)
    powers = np.array([Criteria().power(int(k)) for k in n])
    assert powers[0] == pytest.approx(1.0, abs=0.01)
    assert np.all(np.diff(powers) <= 0)
    assert np.all(np.diff(n * powers) > 0)


@pytest.mark.parametrize(("chi2", "power"), [(80.0, 1.0), (100.0, 1.0), (200.0, 0.8), (1e9, 200 / 300)])
def test_all_of_the_evidence_counts_where_the_likeliest_set_leaves_noise(chi2, power):
    """Of 100 block means: none, half or all of what is left is a rest; the base's own does not matter."""
    j = judge(evidence(weighed([], 0.0, chi2=1e5), weighed(["slack"], 4.0, chi2=chi2)))
    odds = math.exp(4.0 * power) * (0.4 / 3) / 0.4
    assert j.inclusion["slack"] == pytest.approx(odds / (1 + odds))


def test_forms_share_the_prior_of_their_name():
    one = judge(evidence(weighed([], 0.0), weighed(["drift"], 3.0)))
    other = judge(evidence(weighed([], 0.0), weighed(["slack"], 3.0)))
    odds = [j.inclusion[n] / (1 - j.inclusion[n]) for j, n in ((one, "drift"), (other, "slack"))]
    assert odds[1] / odds[0] == pytest.approx(3.0)


def test_a_rest_of_note_makes_found_in_part_and_never_withholds_the_name():
    quiet = judge(evidence(weighed([], 0.0), weighed(["slack"], 30.0, rest=1e-8)))
    loud = judge(evidence(weighed([], 0.0), weighed(["slack"], 30.0, rest=1e-3)))
    assert (quiet.kind, loud.kind) == (Kind.FOUND, Kind.IN_PART)
    assert quiet.names == loud.names == ("slack",)
    assert quiet.inclusion == loud.inclusion


def test_a_base_that_leaves_something_of_note_is_unexplained_and_one_that_does_not_lacks_nothing():
    sets = [weighed(["slack"], -20.0)]
    assert judge(evidence(weighed([], 0.0, rest=1e-8), *sets)).kind is Kind.NOTHING
    assert judge(evidence(weighed([], 0.0, rest=1e-3), *sets)).kind is Kind.UNEXPLAINED


def test_equal_evidence_of_several_names_is_ambiguous():
    j = judge(
        evidence(weighed([], -50.0), weighed(["slack"], 0.0), weighed(["relaxation"], 0.7), weighed(["drift"], 1.0))
    )
    assert j.kind is Kind.AMBIGUOUS
    assert j.names == ()
    assert j.missing == pytest.approx(1.0)


def test_a_name_that_two_sets_share_is_found_though_neither_set_is_sure():
    pair = weighed(["relaxation", "slack"], math.log((0.4 / 3) / (0.15 / 3)) / Criteria().power(100))
    j = judge(evidence(weighed([], -50.0), weighed(["relaxation"], 0.0), pair))
    assert j.inclusion["relaxation"] == pytest.approx(1.0)
    assert j.inclusion["slack"] == pytest.approx(0.5, abs=1e-6)
    assert j.kind in (Kind.FOUND, Kind.IN_PART)
    assert "relaxation" in j.names


def test_an_effect_that_rests_at_neutral_does_not_count():
    j = judge(evidence(weighed([], 0.0), weighed(["slack"], 50.0, void=True)))
    assert j.kind is Kind.NOTHING


def test_evidence_of_simulations_may_be_about_nothing_and_then_what_was_held_beforehand_stands():
    """By hand: overwhelming evidence for slack, one of three effects; with probability 0.2 it says nothing."""
    sets = evidence(weighed([], 0.0), weighed(["slack"], 500.0))
    j = judge(dataclasses.replace(sets, simulated=True), Criteria(lapse=0.2))
    exactly = 0.8 + 0.2 * 0.4 / 3
    with_slack = 0.8 + 0.2 * (0.4 / 3 + 0.15 * 2 / 3 + 0.05)
    expected = {
        Kind.FOUND: exactly,
        Kind.IN_PART: with_slack - exactly,
        Kind.AMBIGUOUS: 0.8 + 0.2 * 0.6 - with_slack,
        Kind.NOTHING: 0.2 * 0.4,
        Kind.UNEXPLAINED: 0.0,
    }
    assert j.probabilities == pytest.approx(expected, abs=1e-9)
    assert j.inclusion == pytest.approx({"slack": with_slack, "relaxation": 0.2 * 0.85 / 3, "drift": 0.2 * 0.85 / 3})
    assert judge(sets, Criteria(lapse=0.2)).confidence == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(10))
def test_no_other_verdict_has_a_larger_stated_probability_where_evidence_may_lapse(seed):
    rng = np.random.default_rng(seed)
    sets = [weighed(n, rng.normal(0, 4), 10 ** rng.uniform(-7, -2)) for n in ([], ["relaxation"], ["slack"], ["drift"])]
    j = judge(dataclasses.replace(evidence(*sets), simulated=True))
    assert j.confidence == max(j.probabilities.values())
    assert sum(j.probabilities.values()) == pytest.approx(1.0)
    assert sum(j.posterior.values()) < 1.0


def test_evidence_comes_back_from_its_file_and_gives_the_same_verdict(tmp_path):
    sets = evidence(weighed([], 0.0), weighed(["slack"], 2.0), weighed(["slack", "drift"], -1.0))
    again = read_evidence(write_evidence(sets, tmp_path / "evidence.json"))
    assert again == sets
    assert judge(again) == judge(sets)
    shy = dataclasses.replace(Criteria(), sizes=(0.9, 0.1, 0.0, 0.0))
    assert judge(again, shy).inclusion["slack"] < judge(again).inclusion["slack"]


def made(seed=0, n=50):
    """Two series that share a law, and a model of two parameters."""
    rng = np.random.default_rng(seed)
    series, stress = [], []
    for name in ("a", "b"):
        time = np.linspace(0, 20, n)
        strain = np.interp(time, [0, 5, 10, 20], [0, 0.3, 0.1, 0.2])
        series.append(Series(name, "pull", time, strain[:, None], loading_states(strain), 100.0))
        stress.append(300 * strain)
    stress, sigma = np.concatenate(stress), np.full(2 * n, 1.3)
    residual = 1.3 * rng.standard_normal(2 * n) + 0.02 * stress * np.repeat([1, -1], n)
    linear = Linear(residual, np.stack([stress, stress**2 / 50], 1), np.array([0.1, 0.2]), np.array([0.5, 3.0]))
    return linear, discrepancy(series, sigma).about(stress), Blocked((slice(0, n), slice(n, 2 * n)), sigma)


def dense(part: Part) -> np.ndarray:
    if part.factor is not None:
        return part.factor @ part.factor.T
    n = len(part.within[0])
    out = np.zeros((2 * n, 2 * n))
    out[:n, :n], out[n:, n:] = part.within
    return out


def test_a_gain_that_wanes_is_a_share_of_the_stress_predicted_and_none_where_time_says_nothing(rng):
    time, stress = np.linspace(0, 20, 50), rng.uniform(10, 90, 50)
    one = Series("a", "", time, time[:, None], np.zeros((50, 3)), 100.0)
    names = [p.name for p in discrepancy([one], np.ones(50)).about(stress)]
    *rest, waning = discrepancy([one], np.ones(50), paced=True).about(stress)
    assert [p.name for p in rest] == names
    lag = np.abs(time[:, None] - time)
    np.testing.assert_allclose(waning.within[0], np.outer(stress, stress) * np.exp(-lag / 10), rtol=1e-12)


def test_slow_wander_is_a_share_of_the_peak_and_fades_in_time():
    """Every amplitude of one is the peak (100); the slow part of one series is correlated and that of two is not."""
    _, parts, _ = made()
    time = np.linspace(0, 20, 50)
    slow = [p.within[0] for p in parts if p.name.startswith("slow")]
    assert slow
    for block in slow:
        fade = -np.log(block[0, 1:] / 100.0**2) / time[1:]
        np.testing.assert_allclose(np.diag(block), 100.0**2)
        np.testing.assert_allclose(fade, fade[0], rtol=1e-9)
        assert fade[0] > 0


def test_the_marginal_is_the_normal_density_with_parameters_integrated_out():
    """With proper priors: y - f ~ N(J (mean - theta), D + sum v B + J weak^-1 J'), by scipy's density."""
    linear, parts, blocked = made()
    v = np.geomspace(1e-5, 1e-3, len(parts))
    found = marginal(linear, parts, v, blocked)
    covariance = np.diag(blocked.sigma**2) + sum(x * dense(p) for x, p in zip(v, parts, strict=True))
    whole = covariance + linear.jacobian @ np.diag(1 / linear.weak) @ linear.jacobian.T
    mean = -linear.jacobian @ linear.offset
    expected = multivariate_normal(mean, whole).logpdf(linear.residual)
    assert found.value + 0.5 * np.sum(np.log(linear.weak)) == pytest.approx(expected, abs=1e-6)


def test_slopes_of_the_marginal_are_difference_quotients():
    linear, parts, blocked = made()
    v = np.full(len(parts), 1e-4)
    slope = marginal(linear, parts, v, blocked).slope
    for k in range(len(parts)):
        up, down = (marginal(linear, parts, v + h * (np.arange(len(v)) == k), blocked).value for h in (1e-8, -1e-8))
        assert slope[k] == pytest.approx((up - down) / 2e-8, rel=2e-3), parts[k].name


def test_the_information_is_the_trace_of_the_dense_matrices():
    """1/2 tr(P B_a P B_b) by dense algebra, for one series (between series P is taken as block-diagonal)."""
    linear, parts, blocked = made()
    n = len(linear.residual) // 2
    half = [
        dataclasses.replace(p, factor=p.factor[:n])
        if p.factor is not None
        else dataclasses.replace(p, within=p.within[:1])
        for p in parts
    ]
    one = Linear(linear.residual[:n], linear.jacobian[:n], linear.offset, linear.weak)
    v = np.geomspace(1e-5, 1e-3, len(parts))
    found = marginal(one, half, v, Blocked((slice(0, n),), blocked.sigma[:n]))
    b = [p.factor @ p.factor.T if p.factor is not None else p.within[0] for p in half]
    covariance = np.diag(blocked.sigma[:n] ** 2) + sum(x * m for x, m in zip(v, b, strict=True))
    p = np.linalg.inv(covariance + one.jacobian @ np.diag(1 / one.weak) @ one.jacobian.T)
    expected = [[0.5 * np.trace(p @ x @ p @ y) for y in b] for x in b]
    np.testing.assert_allclose(found.fisher, expected, rtol=1e-5)


def test_amplitudes_find_the_gain_that_was_put_in_and_rest_where_nothing_is():
    linear, parts, blocked = made()
    widths = Widths(np.full(len(parts), 0.02), np.zeros(len(parts)))
    v, m = amplitudes(linear, parts, widths, blocked, widths.width**2)
    share = dict(zip((p.name for p in parts), np.sqrt(v), strict=True))
    assert math.hypot(share["gain"], share["own law"]) == pytest.approx(0.02, rel=0.5)  # of its own, at any strain
    assert share["law"] < 0.01
    assert share["white"] < 0.006
    assert np.isfinite(amplitude_mass(linear, parts, widths, blocked, v, m))


@pytest.mark.parametrize(("width", "chance"), [(0.02, 0.0), (0.02, 0.1), (0.002, 0.1)])
@pytest.mark.parametrize("name", ["law", "gain", "hysteresis, wide", "slow", "white"])
def test_the_mass_over_one_amplitude_is_its_integral(name, width, chance):
    """One part alone: log of int p(y | a) p(a) da by quadrature over the amplitude, whether it moves or rests."""
    linear, parts, blocked = made(n=40)
    part, priors = [p for p in parts if p.name == name], Widths(np.array([width]), np.array([chance]))
    start, _ = amplitudes(linear, part, priors.widest, blocked, priors.width**2)
    v, m = amplitudes(linear, part, priors, blocked, start)
    a = np.concatenate([np.linspace(0, 0.02, 200), np.linspace(0.0202, 0.3, 280)])
    logs = np.array([marginal(linear, part, np.array([x**2]), blocked).value for x in a])
    density = (1 - chance) * halfnorm(scale=width).pdf(a) + chance * halfnorm(scale=10 * width).pdf(a)
    exact = math.log(np.trapezoid(np.exp(logs - m.value) * density, a))
    tolerance = 0.03 if part[0].factor is not None else 0.25
    assert amplitude_mass(linear, part, priors, blocked, v, m) == pytest.approx(exact, abs=tolerance)


def test_the_mass_of_an_amplitude_far_from_nothing_is_its_integral():
    """What changes slowly is thirty times its prior's width, so that an amplitude near nothing is out of question."""
    linear, parts, blocked = made(n=40)
    (part,) = (p for p in parts if p.name == "slow")
    wave = np.linalg.cholesky(dense(part)[:40, :40] + 1e-6 * np.eye(40)) @ np.random.default_rng(5).standard_normal(40)
    linear = dataclasses.replace(linear, residual=linear.residual + 0.5 * np.concatenate([wave, -wave]))
    priors = Widths(np.array([0.02]), np.array([0.1]))
    v, m = amplitudes(linear, [part], priors, blocked, np.array([0.25]))
    nothing = marginal(linear, [part], np.zeros(1), blocked).value
    assert nothing - m.value < -100  # nats
    a = np.linspace(0.02, 2.0, 1500)
    logs = np.array([marginal(linear, [part], np.array([x**2]), blocked).value for x in a])
    density = 0.9 * halfnorm(scale=0.02).pdf(a) + 0.1 * halfnorm(scale=0.2).pdf(a)
    exact = math.log(np.trapezoid(np.exp(logs - m.value) * density, a))
    assert amplitude_mass(linear, [part], priors, blocked, v, m) == pytest.approx(exact, abs=0.05)


@pytest.mark.parametrize(("matrix", "error"), [([[1.0, 0.5], [0.5, 1.0]], 1e-11), ([[1.0, 1.0], [1.0, 1.0]], 1e-9)])
def test_a_matrix_of_correlations_is_factored_as_it_is_also_where_it_is_singular(matrix, error):
    found, lower = factored(np.array(matrix))
    root = np.tril(found)
    assert lower
    np.testing.assert_allclose(root @ root.T, matrix, rtol=0, atol=error)


def test_the_evidence_along_a_smooth_part_is_exact():
    linear, parts, blocked = made()
    v = np.full(len(parts), 1e-4)
    m = marginal(linear, parts, v, blocked)
    for k, part in enumerate(parts):
        if part.factor is not None:
            to = np.array([0.0, 1e-5, 4e-4, 1e-2])
            other = [marginal(linear, parts, np.where(np.arange(len(v)) == k, x, v), blocked).value for x in to]
            np.testing.assert_allclose(m.along(k, to - 1e-4), np.array(other) - m.value, atol=1e-5)


@pytest.mark.parametrize("scale", [1.0, 1e3, 1e5])
def test_a_part_does_nothing_where_the_parameters_do_all_that_it_does(scale):
    """What lies in the parameters' span changes no density, however large: rounding was up to a thousand nats here."""
    x = np.linspace(0, 1, 60)
    slopes = 1e3 * np.stack([x, x**2, x**3], 1)
    residual = 1e4 * np.random.default_rng(1).standard_normal(60) * x
    linear = Linear(residual, scale * slopes, np.zeros(3), np.zeros(3))
    parts = (Part("law", "law", slopes[:, :2]), Part("white", "white", within=(np.eye(60),)))
    m = marginal(linear, parts, np.zeros(2), Blocked((slice(0, 60),), np.full(60, 1e-3)))
    np.testing.assert_allclose(m.along(0, np.geomspace(1e-8, 10, 20)), 0.0, atol=1e-6)


def test_the_prior_of_an_amplitude_is_two_half_normals():
    priors = Widths(np.array([0.01, 0.02]), np.array([0.0, 0.1]), 10.0)
    a = np.array([0.015, 0.07])
    usual, wide = halfnorm(scale=priors.width).pdf(a), halfnorm(scale=10 * priors.width).pdf(a)
    expected = np.log((1 - priors.chance) * usual + priors.chance * wide)
    np.testing.assert_allclose(priors.log_density(a**2), expected)
    u, h = (a / priors.width) ** 2, 1e-6
    np.testing.assert_allclose(
        priors.slope(u), (priors.log_shape(u + h) - priors.log_shape(u - h)) / (2 * h), rtol=1e-6
    )
    assert priors.wider(a**2).tolist() == [False, bool(0.1 * wide[1] > 0.9 * usual[1])]


def test_the_loading_state_knows_the_way_and_not_the_rate():
    way = np.concatenate([np.linspace(0, 1, 400), np.linspace(1, 0, 400), np.linspace(0, 0.5, 200)])
    slow = np.repeat(way, 3)  # the same path with holds between
    np.testing.assert_allclose(loading_states(slow)[2::3], loading_states(way), atol=1e-12)
    h = loading_states(way)
    assert h[399, 0] == pytest.approx(1.0, abs=1e-3)
    assert h[799, 0] == pytest.approx(-1.0, abs=1e-3)
    # after a path s in one direction the wide state is 1 - exp(-s / 0.3), less what the play takes at the start
    assert h[199, 2] == pytest.approx(1 - math.exp(-(0.5 - 2 * USUAL.band) / 0.3), abs=0.02)
    trembling = 0.5 + 0.4 * USUAL.band * np.sin(np.arange(300.0))
    assert not loading_states(np.concatenate([[0.0, 1.0], trembling]))[2:, 0].max() > 0


def test_what_specimens_share_does_not_carry_how_they_differ():
    """One law, pulled alike, one specimen twice as stiff: no shared part is larger in the stiffer one, a gain is."""
    x = np.linspace(0.0, 0.3, 20)
    alike = {"mode": "extension", "time": x, "strain": np.stack([x, -x / 2], 1), "states": loading_states(x)}
    soft, stiff = Series("soft", peak=100.0, **alike), Series("stiff", peak=200.0, **alike)
    parts = discrepancy([soft, stiff], np.ones(40)).about(np.tile(400 * x, 2))
    for p in parts:
        if p.family in ("law", "hysteresis"):
            np.testing.assert_allclose(p.factor[:20], p.factor[20:], rtol=1e-9, atol=1e-12)
    own = next(p for p in parts if p.family == "gain")
    assert not np.any(own.factor[:20] * own.factor[20:])


PRONY = tuple(f"effects.viscoelasticity.{p}" for p in ("g1", "tau1", "g2", "tau2", "g3", "tau3"))
LOAD = tuple(f"effects.nonlinear-viscosity.{p}" for p in ("g", "tau", "stress", "exponent"))


@pytest.mark.parametrize(
    ("two_times", "by_load", "shown"),
    [
        (-1.0, -10.0, "series/2"),  # inside the likeliest and nearly as likely: its two further constants have no error
        (-4.0, -10.0, "series/3"),  # beaten 55 to 1
        (-1.0, -0.5, "series/2"),  # another law is no plainer for having fewer constants
        (-4.0, -0.5, "series/3"),
        (-1.0, 0.5, "load"),  # the likeliest, and nothing is inside it
    ],
)
def test_a_form_inside_the_likeliest_is_shown_where_that_does_not_beat_it(two_times, by_load, shown):
    forms = {"series/3": (0.0, PRONY), "series/2": (two_times, PRONY[:4]), "load": (by_load, LOAD)}
    sets = [
        dataclasses.replace(
            weighed(["relaxation"], 50.0 + more, chi2=100.0), keys=(form,), free=("energy.mu", *free), k=1 + len(free)
        )
        for form, (more, free) in forms.items()
    ]
    j = judge(evidence(weighed([], 0.0, chi2=100.0), *sets), Criteria(strong=20.0))  # noise is left: all of it counts
    assert j.chosen.keys == (shown,)
    assert j.names == ("relaxation",)

"""Fits of relaxing specimens: number of terms, their sum, their times, where they start; data from own formulas."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tissuejax as tj
from tissuejax.effects.catalogue import effect
from tissuejax.errors import InputError
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.transforms import Box, Sticks, chained, unchained
from tissuejax.estimation.weights import Weights
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting import idle as idle_module
from tissuejax.fitting.idle import merged, roused, woken
from tissuejax.fitting.idle import terms as idle_terms
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.memory import begun_loaded
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem, split
from tissuejax.fitting.starts import fitted_moduli, neutral
from tissuejax.recordings.recording import Channel, Recording, Sample

ONCE = tj.Search(multistart=1)

MU, NOISE = 4000.0, 5.0
STEP = 0.1


def stress(stretch, terms, time):
    """Neo-Hookean quasi-linear viscoelasticity, incompressible, uniaxial: P = l S_a - S_l / l^2.

    Both components of the isochoric PK2 stress relax: increments fade with each tau, exactly for straight pieces.
    """
    trace = stretch**2 + 2 / stretch
    axial, lateral = MU * (1 - trace / (3 * stretch**2)), MU * (1 - trace * stretch / 3)
    out = []
    for s in (axial, lateral):
        left = s.copy()
        for g, tau in terms:
            h = np.zeros_like(s)
            for k, dt in enumerate(np.diff(time)):
                keep = np.exp(-dt / tau)
                h[k + 1] = keep * h[k] + (1 - keep) * tau / dt * (s[k + 1] - s[k])
            left -= g * (s - h)
        out.append(left)
    return stretch * out[0] - out[1] / stretch**2


def pulled(terms, tops=(1.2, 0.85), seed=0, length=60.0, cut=0):
    """Ramp in 2 s, hold, of one specimen in each direction named."""
    rng, made = np.random.default_rng(seed), {}
    time = np.arange(0, length, STEP)
    for i, top in enumerate(tops):
        stretch = np.interp(time, [0, 2, 0.7 * length, 0.75 * length], [1, top, top, 1])
        y = stress(stretch, terms, time) + NOISE * rng.normal(size=len(time))
        channel = Channel(time[cut:], y[cut:], "Pa", NOISE)
        inputs = {"time": time[cut:], "stretch": stretch[cut:]}
        made[f"r{i + 1}"] = Recording(f"r{i + 1}", "uniaxial", inputs, {"nominal_stress": channel}, {"start": 0.0})
    return Sample("s", made)


def test_one_term_is_found_on_tension_and_compression_together():
    found = tj.fit(pulled([(0.35, 8.0)]), "neo-hookean", effects=["viscoelasticity-1"])
    assert found.converged
    assert not found.at_bound
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    truth = {"energy.mu": MU, "effects.viscoelasticity.g1": 0.35, "effects.viscoelasticity.tau1": 8.0}
    for path, true in truth.items():
        assert found.values[path] == pytest.approx(true, abs=4 * found.std[path] + 0.01 * true)
        assert found.std[path] < 0.05 * true
    assert set(found.free) == set(truth)
    moduli = found.record()["shear_modulus"]
    assert moduli["instantaneous"] == pytest.approx(MU, rel=0.03)
    assert moduli["long_term"] == pytest.approx(0.65 * MU, rel=0.03)


@pytest.mark.parametrize("terms", [pytest.param(1, marks=pytest.mark.slow), 2, 3])
@pytest.mark.parametrize(("energy", "seen"), [("reduced-polynomial-2", 1.1), ("demiray", 3.0)])
def test_one_start_leads_to_the_relaxation_that_is_there(energy, seen, terms):
    """From a share of zero at the middle time, a whole step led into a corner: all of the stress, with the longest
    time (chi-square 115 times the noise). The recording is `data/make_demo.py`'s, by closed forms."""
    sample = tj.read(Path(__file__).parents[2] / "data/demo/relaxing.h5")
    found = tj.fit(sample, energy, effects=[f"viscoelasticity-{terms}"], holdout=["holdout"], search=ONCE)
    assert found.chi2_per_dof < seen
    share = sum(v for path, v in found.values.items() if path.startswith("effects.viscoelasticity.g"))
    assert share == pytest.approx(0.35, abs=0.01)


def test_an_idle_series_begins_near_its_time_by_one_term_and_once():
    model = tj.material("neo-hookean", effects=["viscoelasticity-2"])
    posed = problem(predictor(model, pulled([(0.35, 8.0)]), ("r1", "r2")))
    begun = roused(posed, fitted_moduli(posed, posed.start))
    woken_terms = [i for i in (1, 2) if begun[f"effects.viscoelasticity.g{i}"] > 0]
    assert len(woken_terms) == 1
    assert 2 < begun[f"effects.viscoelasticity.tau{woken_terms[0]}"] < 32  # a factor of 4 about the truth
    assert roused(posed, begun) == begun


def test_the_sum_of_the_shares_stays_below_one_where_the_data_would_have_more():
    """Stress that goes on falling, to below zero in the end: the best sum of a free fit is above 1."""
    sample = pulled([(0.6, 2.0), (0.55, 20.0)], tops=(1.2,))
    found = tj.fit(sample, "neo-hookean", effects=["viscoelasticity-2"], search=tj.Search(multistart=2))
    total = sum(found.values[f"effects.viscoelasticity.g{i}"] for i in (1, 2))
    assert 0.9 < total < 1.0
    assert all(found.values[f"effects.viscoelasticity.g{i}"] >= 0 for i in (1, 2))


def test_times_lie_between_the_sampling_and_three_lengths():
    sample = pulled([(0.35, 8.0)])
    fitted, _ = split(sample)
    model = tj.material("neo-hookean", effects=["viscoelasticity-3"])
    posed = problem(predictor(model, sample, fitted))
    for i in (1, 2, 3):
        path = f"effects.viscoelasticity.tau{i}"
        assert posed.bound(path) == pytest.approx((STEP, 3 * 59.9))
        assert STEP < posed.start[path] < 60
    given = problem(
        predictor(model, sample, fitted), unknowns=Unknowns(bounds={"effects.viscoelasticity.tau1": (1e-3, 1.0)})
    )
    assert given.bound("effects.viscoelasticity.tau1") == (1e-3, 1.0)
    fixed = problem(predictor(model, sample, fitted), Unknowns(fix={"effects.viscoelasticity.tau1": 1e-3}))
    assert fixed.start["effects.viscoelasticity.tau1"] == 1e-3


def test_a_ramp_that_is_sampled_finely_tells_of_times_below_the_holds_sampling():
    """2 ms in a ramp of 0.4 s, then 0.5 s: most steps are of the hold."""
    sample = pulled([(0.35, 8.0)], tops=(1.2,))
    r = sample.recordings["r1"]
    time = np.concatenate([np.arange(0, 0.4, 2e-3), np.arange(0.4, 180.0, 0.5)])
    stretch = np.interp(time, [0, 0.4], [1, 1.2])
    channel = Channel(time, stress(stretch, [(0.35, 8.0)], time), "Pa", NOISE)
    uneven = Recording("r1", r.experiment, {"time": time, "stretch": stretch}, {"nominal_stress": channel}, {})
    model = tj.material("neo-hookean", effects=["viscoelasticity-1"])
    posed = problem(predictor(model, Sample("s", {"r1": uneven}), ("r1",)))
    assert posed.bound("effects.viscoelasticity.tau1")[0] == pytest.approx(2e-3)


def test_a_fit_with_effects_starts_once_from_each_smaller_model():
    sample = pulled([(0.35, 8.0)], length=30.0)
    model = tj.material("neo-hookean", effects=["viscoelasticity-1", "slack"])
    posed = problem(predictor(model, sample, ("r1", "r2")))
    relax = {p for p in posed.free if ".viscoelasticity." in p}
    slack = {p for p in posed.free if ".slack." in p}
    assert [set(s) for s in neutral(posed)] == [relax | slack, slack, relax]
    alone = problem(predictor(tj.material("neo-hookean", effects=["slack"]), sample, ("r1", "r2")))
    assert [set(s) for s in neutral(alone)] == [slack]  # without it nothing is left to leave out: no second descent
    assert neutral(problem(predictor(tj.material("neo-hookean"), sample, ("r1", "r2")))) == []


@pytest.mark.slow
def test_a_larger_model_is_never_worse_than_the_one_inside_it():
    sample = pulled([(0.35, 8.0)], length=30.0)
    smaller = tj.fit(sample, "neo-hookean", effects=["viscoelasticity-1"])
    larger = tj.fit(sample, "neo-hookean", effects=["viscoelasticity-1", "slack"])
    assert larger.chi2 <= smaller.chi2 * (1 + 1e-6)


def test_a_recording_cut_out_of_a_longer_one_is_told_so():
    whole = tj.fit(pulled([(0.35, 8.0)], length=30.0), "neo-hookean", effects=["viscoelasticity-1"], search=ONCE)
    assert not any("begins under load" in w for w in whole.warnings)
    rest = tj.fit(
        pulled([(0.35, 8.0)], length=30.0, cut=230),
        "neo-hookean",
        effects=["viscoelasticity-1"],
        search=ONCE,
    )
    assert any("begins under load" in w for w in rest.warnings)
    elastic = tj.fit(pulled([(0.35, 8.0)], length=30.0, cut=230), "neo-hookean", search=ONCE)
    assert not any("begins under load" in w for w in elastic.warnings)


@pytest.mark.parametrize(("first", "said"), [((1.0, 1.15), "1.15"), ((1.1, 1.05), "1.1"), ((1.05, 0.9), "0.9")])
def test_a_recording_cut_out_says_the_stretch_of_the_axis_that_is_farthest_from_rest(first, said):
    time = np.linspace(0, 10, 41)
    drive = np.stack([np.interp(time, [0, 5, 10], [at, 1.3, 1.3]) for at in first], 1)
    channel = Channel(time, 1e3 * (drive - 1), "Pa", 5.0)
    made = Recording("r", "biaxial", {"time": time, "stretch": drive}, {"nominal_stress": channel}, {})
    (told,) = begun_loaded({"r": made}, ["r"], Weights({"r/nominal_stress": 5.0}))
    assert told.startswith(f"r (stretch {said}) begins under load")


@pytest.mark.parametrize(
    ("name", "terms"),
    [("viscoelasticity", 1), ("viscoelasticity-2", 2), ("viscoelasticity-1", 1), ("viscoelasticity-5", 5)],
)
def test_the_number_of_terms_is_part_of_the_name(name, terms):
    assert len(effect(name).amplitudes) == terms


@pytest.mark.parametrize("name", ["viscoelasticity-0", "viscoelasticity-6", "slack-2", "viscoelastic-2"])
def test_other_numbers_are_refused(name):
    with pytest.raises(InputError):
        effect(name)


def test_parts_of_a_whole_against_differences(rng):
    box = Box([0, 0, 0, -5], [1, 1, 1, 5], [0.1, 0.1, 0.1, 1], sticks=[Sticks((0, 2, 1), 0.8)])
    x = np.array([0.3, 0.1, 0.25, 2.0])
    y = box.free(x)
    back, slope = box.bounded(y)
    np.testing.assert_allclose(back, x, atol=1e-12)
    numeric = np.stack([(box.bounded(y + h)[0] - box.bounded(y - h)[0]) / 2e-6 for h in 1e-6 * np.eye(4)], axis=1)
    np.testing.assert_allclose(slope, numeric, atol=1e-8)
    jacobian = rng.normal(size=(7, 4))
    np.testing.assert_allclose(unchained(chained(jacobian, slope), slope), jacobian, atol=1e-10)
    for far in 50 * rng.normal(size=(20, 4)):
        parts = box.bounded(far)[0]
        assert np.all(parts[:3] >= 0)
        assert parts[:3].sum() < 0.8
    crowded = box.bounded(box.free(np.array([0.6, 0.6, 0.6, 0.0])))[0]
    assert crowded[:3].sum() < 0.8


def test_every_kind_of_bound_has_its_formula_and_its_slope():
    """Both, lower, upper, none, none over decades; differences tell of the slope, also far from rest."""
    inf, scale = np.inf, np.array([0.5, 2.0, 3.0, 4.0, 5.0])
    box = Box([-1, -2, -inf, -inf, -inf], [7, inf, 6, inf, inf], list(scale), wide=[False] * 4 + [True])
    for at in (-3.0, -0.4, 0.0, 1.1, 2.5):
        y, grown = np.full(5, at), np.log1p(np.exp([at, -at]))
        x, slope = box.bounded(y)
        formula = [-1 + 8 / (1 + np.exp(-at)), -2 + 2 * grown[0], 6 - 3 * grown[1], 4 * at, 5e-3 * np.sinh(at)]
        np.testing.assert_allclose(x, formula, rtol=1e-12)
        np.testing.assert_allclose(box.free(x), y, atol=1e-9)
        numeric = (box.bounded(y + 1e-5)[0] - box.bounded(y - 1e-5)[0]) / 2e-5
        np.testing.assert_allclose(slope, numeric, rtol=1e-7)


def test_an_idle_term_wakes_where_it_is_needed():
    """A descent from a term without a share leaves it there; woken at the time that was missing it finds both."""
    truth = [(0.2, 0.6), (0.3, 15.0)]
    posed = problem(predictor(tj.material("neo-hookean", effects=["viscoelasticity-2"]), pulled(truth), ("r1", "r2")))
    name = "effects.viscoelasticity."
    dead = posed.start | {"energy.mu": MU, f"{name}g1": 0.4, f"{name}tau1": 12.0, f"{name}g2": 0.0, f"{name}tau2": 12.0}
    stuck = descend(posed, dead)
    left = posed.values(stuck.y)
    assert left[f"{name}g2"] < 1e-3
    assert stuck.cost > 3 * posed.n_samples
    ready = woken(posed, left)
    assert 0.2 < ready[f"{name}tau2"] < 2.0
    found = descend(posed, ready)
    assert 2 * found.cost == pytest.approx(posed.n_samples, rel=0.1)
    values = posed.values(found.y)
    pairs = sorted((values[f"{name}tau{i}"], values[f"{name}g{i}"]) for i in (1, 2))
    assert pairs == [pytest.approx((0.6, 0.2), rel=0.05), pytest.approx((15.0, 0.3), rel=0.05)]
    assert woken(posed, values) is None


def test_a_term_is_tried_at_times_even_in_their_logarithm_between_its_bounds(monkeypatch):
    """Nine inside (lower, upper); where zero bounds it, nine decades under the upper end are the lower one."""
    posed = problem(predictor(tj.material("neo-hookean", effects=["viscoelasticity"]), pulled([(0.3, 8.0)])))
    share, time = (f"effects.viscoelasticity.{n}1" for n in ("g", "tau"))
    tried = []
    monkeypatch.setattr(idle_module, "_scored", lambda *given: tried.append([c[time] for c in given[3]]) or None)
    for lower, upper in ((0.5, 50.0), (0.0, 50.0)):
        monkeypatch.setattr(Problem, "bound", lambda self, path, ends=(lower, upper): ends)
        assert idle_module._promising(posed, posed.start, share, time, {share, time}) is None
    least = np.array([0.5, 50e-9])
    expected = [a * (50 / a) ** (np.arange(1, 10) / 10) for a in least]
    np.testing.assert_allclose(tried, expected, rtol=1e-9)


def test_shapes_of_an_idle_modulus_are_drawn_evenly_over_all_they_may_be():
    """A bounded one over its range, one without an end from a tenth to a hundred times its typical value."""
    known = {"open": SimpleNamespace(typical=2.0), "angle": SimpleNamespace(typical=1.0)}
    bounds = {"open": (0.0, np.inf), "angle": (1.0, 3.0)}
    posed = SimpleNamespace(
        bound=bounds.get, predictor=SimpleNamespace(model=SimpleNamespace(parameters=known)), free=list(known)
    )
    drawn = idle_module._drawn(posed, list(known))
    decades, angle = np.log10([d["open"] / 2.0 for d in drawn]), np.array([d["angle"] for d in drawn])
    assert len(drawn) == 64
    for values, low, high in ((decades, -1, 2), (angle, 1, 3)):
        inner = (np.sort(values) - low) / (high - low)
        np.testing.assert_allclose(inner, (np.arange(64) + 0.5) / 64, atol=1 / 64)  # one in every 64th


def test_terms_at_one_time_are_one():
    posed = problem(
        predictor(tj.material("neo-hookean", effects=["viscoelasticity-3"]), pulled([(0.3, 8.0)]), ("r1", "r2"))
    )
    name = "effects.viscoelasticity."
    twins = posed.start | {f"{name}g{i}": 0.1 * i for i in (1, 2, 3)}
    twins |= {f"{name}tau1": 8.0, f"{name}tau2": 1.0, f"{name}tau3": 8.0}
    together, idle = merged(posed, twins)
    assert together[f"{name}g1"] == pytest.approx(0.4)
    assert idle == [(f"{name}g3", f"{name}tau3")]
    np.testing.assert_allclose(posed.residuals(together), posed.residuals(twins), rtol=1e-9, atol=1e-9)
    assert idle_terms(posed) == [[(f"{name}g{i}", f"{name}tau{i}") for i in (1, 2, 3)]]

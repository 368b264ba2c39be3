"""The small rules that a fit is made of, each against its formula, scipy, or what it must do with known numbers."""

import dataclasses
import itertools
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from toy import TRUE, ToyModel, ToyPredictor, problem, toy_sample

from tissuejax.errors import InputError
from tissuejax.estimation.losses import soften
from tissuejax.estimation.numerical import changes
from tissuejax.estimation.transforms import WHOLE
from tissuejax.estimation.weights import Weights, noise
from tissuejax.experiments.probing_settings import REFINED, ProbingSettings
from tissuejax.fitting import sobol as sobol_module
from tissuejax.fitting.cut_resolution import resolution
from tissuejax.fitting.gradient_descent import objective
from tissuejax.fitting.least_squares import fit
from tissuejax.fitting.memory import LENGTHS, begun_loaded, spread
from tissuejax.fitting.options import Search
from tissuejax.fitting.profile import profile
from tissuejax.fitting.scores import score
from tissuejax.fitting.separable import Projection
from tissuejax.fitting.sobol import sobol
from tissuejax.fitting.starts import LEAST, SPREAD, fitted_moduli, variations
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel, Recording, Sample


class Shared(ToyPredictor):
    """Beside the curve's constants some that it does not depend on: three parts of one whole, one that is bounded
    from above and one that is not bounded; priors alone tell of them."""

    class model(ToyModel):  # noqa: N801
        parameters = ToyModel.parameters | {
            **{f"effects.e.g{i}": Parameter(f"g{i}", "1", 0.1, lower=0.0, upper=1.0) for i in (1, 2, 3)},
            "effects.e.below": Parameter("below", "1", -2.0, upper=1.0),
            "effects.e.any": Parameter("any", "1", 3.0),
        }
        effects = (SimpleNamespace(name="e", shares=("g1", "g2", "g3")),)


@pytest.mark.parametrize(("name", "scipys"), [("soft-l1", "soft_l1"), ("cauchy", "cauchy")])
def test_softened_squares_are_scipy_s_losses(name, scipys):
    """scipy minimises sum rho(r^2) / 2: its cost at fixed residuals is the reference, differences that of the slope."""
    r = np.array([-7.0, -1.0, -1e-3, 0.0, 1e-9, 0.4, 3.0, 40.0])
    size, slope = soften(name, r)
    # the first cost that scipy sees, at residuals that don't depend on x
    known = [scipy.optimize.least_squares(lambda x, at=at: at + 0 * x, 0.0, loss=scipys).cost for at in r]
    np.testing.assert_allclose(size**2, 2 * np.array(known), rtol=1e-6, atol=1e-15)
    assert np.all(np.sign(size) == np.sign(r))
    large = np.abs(r) > 1e-2
    ahead, behind = (soften(name, r + d)[0] for d in (1e-6, -1e-6))
    np.testing.assert_allclose(slope[large], ((ahead - behind) / 2e-6)[large], rtol=1e-6)


def test_the_profile_of_a_linear_parameter_is_a_parabola_at_even_steps(rng):
    """One free parameter that enters linearly: chi-square rises by ((x - best) / std)^2, at even steps to 3 std."""
    sample = toy_sample(rng, TRUE)
    found = fit(problem(sample, ("energy.offset",)), search=Search(multistart=1))
    std, best = found.std["energy.offset"], found.values["energy.offset"]
    got = profile(found, "energy.offset", reach=3.0, points=6)
    np.testing.assert_allclose((got.values - best) / std, np.arange(-6, 7) / 2, atol=1e-9)
    np.testing.assert_allclose(got.rise, ((got.values - best) / std) ** 2, atol=1e-6)
    assert got.interval == pytest.approx((best - 1.95996 * std, best + 1.95996 * std), rel=1e-4)


@pytest.mark.parametrize(("times", "own"), [(0.95, True), (1.05, False)])
def test_a_scan_goes_by_the_standard_error_up_to_ten_times_the_size(rng, times, own):
    """Ten times scale and estimate together (10 and 5 Pa); beyond that by the larger of the two, on and on while flat:
    three times as far."""
    level = float(times * 10 * (10.0 + 5.0) * np.sqrt(800))
    sample = toy_sample(rng, TRUE, noise=0.0)
    off = rng.normal(size=800)
    off = level * (off - off.mean()) / off.std()  # estimated is the true offset
    for k, (name, r) in enumerate(sample.recordings.items()):
        c = r.channels["nominal_stress"]
        c = Channel(c.time, c.values + off[400 * k : 400 * k + 400], "Pa", level)
        sample.recordings[name] = Recording(name, "toy", r.inputs, {"nominal_stress": c}, {})
    found = fit(problem(sample, ("energy.offset",)), search=Search(multistart=1))
    assert found.std["energy.offset"] == pytest.approx(times * 150.0, rel=1e-6)
    got = profile(found, "energy.offset", reach=3.0, points=6)
    steps = np.arange(-6, 7) * found.std["energy.offset"] / 2 if own else np.arange(-18, 19) * 5.0
    np.testing.assert_allclose(got.values, 5.0 + steps, atol=1e-3)


def test_what_numerical_choices_leave_open_is_the_distance_to_the_limit():
    """Residuals that go as h^2, as the pace and as one over the penalty have a known limit."""
    L, mesh, pace, give = np.array([1.0, -2.0]), np.array([0.3, 0.1]), np.array([0.05, 0.2]), np.array([0.4, -0.1])
    here = ProbingSettings()
    at = lambda s: L + mesh / s.elements**2 + pace * s.compression + give / s.penalty  # noqa: E731

    class Settings(SimpleNamespace):
        @property
        def coarse(self):
            return self.changed(compression=2 * self.compression)

        @property
        def finer(self):
            return self.changed(elements=self.elements * REFINED)

        def changed(self, **what):
            return Settings(**(vars(self) | what))

    assert np.allclose(np.divide(here.finer.counts, here.counts), REFINED, rtol=0.06)
    settings = Settings(elements=2.0, compression=1.5, penalty=0.7)
    predictor = SimpleNamespace(settings=settings, with_settings=lambda s: s)
    posed = SimpleNamespace(predictor=predictor, misfit=lambda residuals, values: residuals)
    simulated = SimpleNamespace(all=lambda predictors, values: [at(s) for s in predictors])
    seen = changes(posed, {}, simulated.all, finer=True, numerical=True)
    fine = settings.finer
    np.testing.assert_allclose(seen.final, at(fine), rtol=1e-12)
    np.testing.assert_allclose(seen.left["mesh"], -mesh / fine.elements**2, rtol=1e-12)
    np.testing.assert_allclose(seen.left["step"], -pace * settings.compression, rtol=1e-12)
    np.testing.assert_allclose(seen.left["penalty"], -give / settings.penalty, rtol=1e-12)


@pytest.mark.parametrize(("kind", "rest"), [("shear", 0.0), ("stretch", 1.0)])
def test_a_recording_that_begins_away_from_rest_is_told_in_either_kind(kind, rest):
    time = np.linspace(0, 10, 101)

    def told(first):
        drive = rest + np.interp(time, [0, 5, 10], [first, 0.2, 0.2])
        channel = Channel(time, 1e3 * (drive - rest), "Pa", 5.0)
        made = Recording("r", "uniaxial", {"time": time, kind: drive}, {"nominal_stress": channel}, {})
        return begun_loaded({"r": made}, ["r"], Weights({"r/nominal_stress": 5.0}))

    assert told(0.0) == []
    (said,) = told(0.1)
    assert f"r ({kind} {rest + 0.1:.4g}) begins under load" in said


def test_levels_that_were_not_recorded_are_one_a_unit_or_one_a_recording(rng):
    """In "auto" recordings of one unit share a level, newtons and pascals don't; "relative" weighs each by its size."""
    time, recordings = np.linspace(0, 4, 50), {}
    for name, unit, size in (("r1", "Pa", 100.0), ("r2", "Pa", 1.0), ("r3", "N", 7.0)):
        channel = Channel(time, size * np.ones(50), unit, None)
        recordings[name] = Recording(name, "toy", {"time": time}, {"c": channel}, {})
    keys = ("r1/c", "r2/c", "r3/c")
    auto = noise(Sample("s", recordings), tuple(recordings), "auto")
    assert [auto.groups[k] for k in keys] == ["Pa", "Pa", "N"]
    assert auto.std["r1/c"] == auto.std["r2/c"] == pytest.approx(auto.std["r3/c"] * np.sqrt(5000.5) / 7)
    relative = noise(Sample("s", recordings), tuple(recordings), "relative")
    assert len(set(relative.groups.values())) == 1
    assert relative.std["r1/c"] / relative.std["r2/c"] == pytest.approx(100.0)


def test_a_modulus_that_nothing_depends_on_stays_a_number():
    """A column of zeros beside one that counts: least squares of the other, and no division by zero."""
    J = np.stack([np.linspace(1, 2, 8), np.zeros(8)], 1)
    wanted = np.array([3.0, 0.0])
    solver = SimpleNamespace(low=np.array([0.0, -1.0]), high=np.array([10.0, 10.0]))
    with np.errstate(all="raise"):
        solved, left, inside = Projection.solve(solver, J @ [1.0, 0.0] - J @ wanted, J, np.array([1.0, 0.0]))
    np.testing.assert_allclose(solved, wanted, atol=1e-12)
    np.testing.assert_allclose(left, 0, atol=1e-12)
    assert inside.all()


def test_numbers_in_the_sentences_on_a_cut_s_resolution():
    """Strength from which the flats part the tissue, 2 G / b; the element that suits both, where tau_h = 2 G / b."""
    G, b, h = 3.0, 5e-4, 5e-4  # not 2: its double is its square
    said = resolution(1e4, G, 1564.0, 2e4, b, h, 0.02, 0.005).sentences
    (both,) = [s for s in said if "no strength suits both" in s]
    assert f"at least {2 * G / b:.4g} Pa" in both
    plane = 4 * 1564.0 * (2e4 + 1564.0 / 3) / (2e4 + 4 * 1564.0 / 3)
    size = 9 * np.pi * plane * G / (32 * 3 * (2 * G / b) ** 2)
    assert f"elements of {1e3 * size:.3g} mm are needed" in both
    thin = resolution(4000.0, G, 1564.0, 2e4, b, 1e-5, 0.02, 0.005).sentences
    assert any(f"A strength above {2 * G / b:.4g} Pa parts it" in s for s in thin)


def test_a_score_is_what_its_names_are_defined_as():
    """Errors 1/2, 0, -1, 0 and a lost sample about a mean of 3: squares 5/4 of a total of 10."""
    measured = [1.0, 2.0, np.nan, 4.0, 5.0]
    told = score(measured, [1.5, 2.0, 7.0, 3.0, 5.0], 0.25, "Pa")
    assert dataclasses.astuple(told) == pytest.approx((0.3125**0.5, "Pa", 5.0, 4, 0.875, 0.0))
    assert score(measured, measured, 1.0, "Pa").r2 == 1.0
    assert score(measured, np.full(5, 3.0), 1.0, "Pa").r2 == 0.0
    flat = score(np.full(8, 3.0), 3.0 + (-1.0) ** np.arange(8), 0.5, "Pa")
    assert np.isnan(flat.r2)  # no spread to explain
    assert (flat.rmse, flat.chi2_per_sample, flat.autocorrelation) == (1.0, 4.0, -7 / 8)
    lost = score(np.full(3, np.nan), np.zeros(3), 1.0, "Pa")
    assert lost.n == 0
    assert np.isnan([lost.rmse, lost.chi2_per_sample, lost.r2]).all()


def test_parts_of_a_whole_share_what_the_fixed_ones_leave(rng):
    sample, g = toy_sample(rng, TRUE, n=10), [f"effects.e.g{i}" for i in (1, 2, 3)]
    part = problem(sample, ("energy.a", g[2], g[1]), Shared, start={g[0]: 0.3})
    (group,) = part.box.sticks
    assert group.members == (2, 1)  # in the order of the shares
    full = part.box.bounded(np.full(3, 50.0))[0]  # each takes the most of what is left
    assert full[2] == pytest.approx(0.7 * WHOLE)
    assert full[1] == pytest.approx(0.7 * (1 - WHOLE) * WHOLE)
    (group,) = problem(sample, tuple(g), Shared).box.sticks
    assert group.whole == 1.0
    assert problem(sample, tuple(g[:2]), Shared, start={g[2]: 1.0}).box.sticks == ()  # nothing is left
    assert problem(sample, tuple(g), Shared, bounds={g[1]: (0.0, 0.5)}).box.sticks == ()


@pytest.mark.parametrize(("loss", "scipys"), [("squares", "linear"), ("soft-l1", "soft_l1"), ("cauchy", "cauchy")])
def test_what_gradient_methods_minimise_is_half_the_losses_of_data_and_priors(rng, loss, scipys):
    """At known values, each of the five kinds of bounds among them; the cost of fixed residuals is scipy's."""
    at = TRUE | {"energy.offset": -3.0, "effects.e.g1": 0.2, "effects.e.g2": 0.5, "effects.e.g3": 0.15}
    at |= {"effects.e.below": 0.4, "effects.e.any": -7.0}
    priors = {path: (0.8 * value + 0.1, 0.3 * abs(value)) for path, value in at.items()}
    sample = toy_sample(rng, TRUE, n=20, noise=2.0)
    p = problem(sample, tuple(at), Shared, priors=priors, loss=loss)
    r = [(at[path] - mean) / std for path, (mean, std) in priors.items()]
    for recording in sample.recordings.values():
        channel = recording.channels["nominal_stress"]
        rate = at["energy.rate"] * channel.time
        y = at["energy.a"] * np.exp(-rate) + at["energy.b"] * np.exp(-3 * rate) + at["energy.offset"]
        r.extend((y - channel.values) / 2.0)
    expected = scipy.optimize.least_squares(lambda x: np.array(r) + 0 * x, 0.0, loss=scipys).cost
    assert float(jax.jit(objective(p))(p.box.free(p.vector(at)))) == pytest.approx(expected, rel=1e-9)


def test_moduli_to_begin_with_are_the_non_negative_least_squares(rng):
    """scipy's at two rates; at the slow one the slow term comes out as zero and keeps a thousandth of the data."""
    sample, zeros = toy_sample(rng, TRUE, n=40), []
    p = problem(sample, ("energy.a", "energy.b", "energy.rate"))
    channels = [r.channels["nominal_stress"] for r in sample.recordings.values()]
    t, y = (np.concatenate([getattr(c, what) for c in channels]) for what in ("time", "values"))
    for rate in (0.7, 0.2):
        columns = np.exp(-rate * t[:, None] * [1, 3])
        solved = scipy.optimize.nnls(columns, y - TRUE["energy.offset"])[0]
        least = LEAST * np.linalg.norm(y - TRUE["energy.offset"]) / np.linalg.norm(columns, axis=0)
        found = fitted_moduli(p, p.start | {"energy.rate": rate, "energy.a": 1.0, "energy.b": 1.0})
        assert [found["energy.a"], found["energy.b"]] == pytest.approx(np.maximum(solved, least), rel=1e-6)
        assert found["energy.rate"] == rate
        zeros.append(int(np.sum(solved == 0)))
    assert zeros == [0, 1]


@pytest.mark.parametrize("begun", [-2.0, 0.0, 2.0])
def test_a_modulus_that_is_not_asked_for_keeps_the_sign_of_its_start(rng, begun):
    """Data without offset: a thousandth of them on the side where it began, and nothing where it began at nothing."""
    p = problem(toy_sample(rng, TRUE | {"energy.offset": 0.0}, n=40, noise=0.0), ("energy.a", "energy.offset"))
    channels = [r.channels["nominal_stress"] for r in p.predictor.sample.recordings.values()]
    data = np.concatenate([c.values - TRUE["energy.b"] * np.exp(-2.1 * c.time) for c in channels])
    found = fitted_moduli(p, p.start | {"energy.a": 1.0, "energy.offset": begun})
    least = LEAST * np.sqrt(np.mean(data**2))
    assert found["energy.offset"] == pytest.approx(np.sign(begun) * least, rel=1e-6, abs=1e-9 * least)
    assert found["energy.a"] == pytest.approx(TRUE["energy.a"], rel=1e-6)


def test_further_starts_vary_by_what_is_stated(rng):
    """Logarithms by 0.7, signs kept; from zero by 0.7 of the scale; beyond a range anywhere in its inner 96 %."""
    n, first = 1000, TRUE | {"energy.a": 80.0, "energy.b": 40.0, "energy.rate": 10.0, "energy.offset": 0.0}
    p = problem(toy_sample(rng, TRUE, n=10), tuple(TRUE))
    drawn = {path: np.array([v[path] for v in variations(p, first, n, 3)]) for path in TRUE}
    steps = [np.log(drawn["energy.a"] / 80.0), np.log(drawn["energy.b"] / 40.0), drawn["energy.offset"] / 10.0]
    steps.append(np.log([v["energy.offset"] / -5.0 for v in variations(p, first | {"energy.offset": -5.0}, n, 4)]))
    for step in steps:  # four standard errors
        assert np.std(step) == pytest.approx(SPREAD, abs=4 * SPREAD / np.sqrt(2 * n))
        assert np.mean(step) == pytest.approx(0.0, abs=4 * SPREAD / np.sqrt(n))
    rate = drawn["energy.rate"]
    assert np.all((rate > 0) & (rate < 20))
    beyond = scipy.stats.norm.sf(np.log(2) / SPREAD)
    below = 0.5 + 0.5 * beyond
    assert np.mean(rate < 10) == pytest.approx(below, abs=4 * np.sqrt(below * (1 - below) / n))


def test_moduli_between_bounds_are_the_best_of_all_faces(rng):
    """The minimum of a convex problem by trying which bounds hold; columns that differ ten thousandfold in size."""
    low, high, at_bound = np.array([0.5, -30.0, -2.0]), np.array([2.0, 30.0, 400.0]), 0
    size = np.array([1.0, 0.01, 100.0])
    for _ in range(20):
        J, target = rng.normal(size=(12, 3)) * size, 2.0 * rng.normal(size=12)
        faces = []
        for held in itertools.product((low, high, None), repeat=3):
            x = np.array([0.0 if end is None else end[i] for i, end in enumerate(held)])
            loose = [i for i, end in enumerate(held) if end is None]
            x[loose] = np.linalg.lstsq(J[:, loose], target - J @ x, rcond=None)[0]
            if np.all((x >= low) & (x <= high)):
                faces.append((float(np.sum((J @ x - target) ** 2)), tuple(x), tuple(end is None for end in held)))
        _, best, loose = min(faces)
        now = np.array([1.0, 2.0, 3.0])
        solved, left, inside = Projection.solve(SimpleNamespace(low=low, high=high), J @ now - target, J, now)
        np.testing.assert_allclose(solved * size, best * size, atol=1e-8)
        np.testing.assert_allclose(left, J @ best - target, atol=1e-8)
        assert tuple(inside) == loose
        mirrored = Projection.solve(SimpleNamespace(low=-high, high=-low), J @ now - target, -J, -now)
        assert tuple(mirrored[2]) == loose
        at_bound += not all(loose)
    assert at_bound > 5


def test_what_moduli_can_absorb_is_taken_out_of_the_other_columns(rng):
    """Kaufman's (1 - C C+) J with the pseudo-inverse, C the columns of those moduli that rest on no bound."""
    J, linear = rng.normal(size=(9, 5)), np.array([True, False, True, True, False])
    solver = SimpleNamespace(linear=linear, low=np.array([0.0, 0.0, 0.0]), high=np.array([9.0, 9.0, 9.0]))
    for x, loose in (([1.0, 0, 2.0, 3.0, 0], [0, 2, 3]), ([1.0, 0, 0.0, 3.0, 0], [0, 3]), ([9.0, 0, 0.0, 0.0, 0], [])):
        C = J[:, loose]
        expected = J[:, ~linear] - C @ np.linalg.pinv(C) @ J[:, ~linear]
        np.testing.assert_allclose(Projection._projected(solver, J, np.array(x)), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("still", "top", "limit"),
    [
        (4, 200.0, 10.0),  # four standard errors of the mean of four samples
        (5, 200.0, 4 * 5 / 5**0.5),  # of the first five where nothing is done in them
        (4, 400.0, 12.0),  # 3 % of the largest stress
    ],
)
def test_a_load_at_rest_is_told_from_its_limit_on(still, top, limit):
    time, up = np.arange(40.0), np.clip((np.arange(40) - still + 1) / 20, 0, 1)

    def told(level, sign=1):
        stress = np.where(up > 0, top * up, level + 2.0 * (-1.0) ** np.arange(40))
        stress[still - 1] = still * level - stress[: still - 1].sum()
        channel = Channel(time, sign * stress, "Pa", 5.0)
        made = Recording("r", "uniaxial", {"time": time, "stretch": 1 + 0.2 * up}, {"nominal_stress": channel}, {})
        return begun_loaded({"r": made}, ["r"], Weights({"r/nominal_stress": 5.0}))

    assert told(0.98 * limit) == []
    for sign in (1, -1):
        (said,) = told(1.02 * limit, sign)
        assert f"r (a stress of {1.02 * limit:.3g} Pa at rest) begins under load" in said


def test_times_to_begin_with_are_even_in_their_logarithm():
    """Between the bounds, the slower one at the length of the recording; each effect's own."""
    one = {f"effects.one.tau{i}": (1.0, LENGTHS * 1e4) for i in (1, 2, 3)}
    other = {"effects.other.tau1": (0.01, LENGTHS * 100.0)}
    assert list(spread(one | other).values()) == pytest.approx([10.0, 100.0, 1000.0, 1.0])


def test_sobol_indices_of_a_product_are_those_by_hand(rng):
    """y = a exp(-k t) + c: V = Va E(e)^2 + E(a)^2 Ve + Va Ve + Vc; interaction is in the totals of a and k alone."""
    predictor = ToyPredictor(toy_sample(rng, TRUE, n=30, names=("r1",)))
    ranges = {"energy.a": (50.0, 150.0), "energy.rate": (0.2, 1.0), "energy.offset": (-10.0, 10.0)}
    found = sobol(predictor, TRUE | {"energy.b": 0.0}, ranges, n=1024)
    t = np.linspace(0, 3, 30)[np.linspace(0, 29, 12).round().astype(int)]
    e = np.exp(-t[:, None] * (0.2 + 0.8 * (np.arange(1000) + 0.5) / 1000))
    a, k, both, c = 1e4 / 12 * e.mean(1) ** 2, 1e4 * e.var(1), 1e4 / 12 * e.var(1), np.full(12, 400 / 12)
    total = np.sum(a + k + both + c)
    first = np.array([a.sum(), k.sum(), c.sum()]) / total
    np.testing.assert_allclose(found.first["r1/nominal_stress"], first, atol=0.03)
    whole = first + both.sum() / total * np.array([1, 1, 0])
    np.testing.assert_allclose(found.total["r1/nominal_stress"], whole, atol=0.03)
    assert (found.n, found.failed) == (5 * 1024, 0.0)


def test_sobol_indices_are_told_by_component(rng):
    """Two components, one that a parameter moves and one that the other does; a third that neither moves has none."""

    class Apart(ToyPredictor):
        def predict(self, values):
            t = self._time("r1")
            y = jnp.stack([values["energy.a"] * t, values["energy.offset"] * t, t], axis=1)
            return {"r1": self._recording("r1", y)}

    ranges = {"energy.a": (50.0, 150.0), "energy.offset": (-10.0, 10.0)}
    found = sobol(Apart(toy_sample(rng, TRUE, n=9, names=("r1",))), TRUE, ranges, n=256)
    keys = [f"r1/nominal_stress[{i}]" for i in range(3)]
    assert list(found.first) == list(found.total) == keys
    for told in (found.first, found.total):
        np.testing.assert_allclose([told[k] for k in keys], [[1, 0], [0, 1], [0, 0]], atol=0.02)


@pytest.mark.parametrize("n", [0, 1, 3, 96])
def test_sobol_draws_that_are_no_power_of_two_are_refused(rng, n):
    ranges = {"energy.a": (50.0, 150.0), "energy.rate": (0.2, 1.0)}
    with pytest.raises(InputError, match=f"n = {n}: it must be a power of two"):
        sobol(ToyPredictor(toy_sample(rng, TRUE, n=5)), TRUE, ranges, n=n)


def test_sobol_indices_are_the_same_in_batches_and_one_by_one(rng, monkeypatch):
    """20 predictions in batches of 8, the last one filled up; where half of them fail, that is the share told."""

    class Failing(ToyPredictor):
        def predict(self, values):
            a = values["energy.a"]
            return super().predict(dict(values) | {"energy.a": jnp.where(a > 100.0, jnp.nan, a)})

    monkeypatch.setattr(sobol_module, "BATCH", 8)
    sample = toy_sample(rng, TRUE, n=15, names=("r1",))
    ranges = {"energy.a": (50.0, 150.0), "energy.rate": (0.2, 1.0), "energy.b": (0.0, 10.0)}
    for kind, failed in ((ToyPredictor, 0.0), (Failing, 0.5)):
        many, one = (sobol(kind(sample), TRUE, ranges, n=4, batched=b) for b in (True, False))
        for told in ("first", "total"):
            np.testing.assert_allclose(*(getattr(s, told)["r1/nominal_stress"] for s in (many, one)), rtol=1e-9)
        assert many.n == one.n == 20
        assert many.failed == one.failed == pytest.approx(failed, abs=0.2)

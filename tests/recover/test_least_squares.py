"""The fitting room on a predictor in closed form: estimates, errors, intervals, methods, refusals."""

import contextlib

import numpy as np
import pytest
import scipy.optimize
import scipy.signal
from toy import ToyPredictor, curve, toy_sample

from tissuejax.errors import InputError, NotConverged
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.weights import noise
from tissuejax.fitting import serial as serial_module
from tissuejax.fitting.advice import mean_factor
from tissuejax.fitting.least_squares import descend, fit, required
from tissuejax.fitting.options import Search
from tissuejax.fitting.profile import profile
from tissuejax.recordings.recording import Channel, Recording, Sample

ONCE = Search(multistart=1)

TRUE = {"energy.a": 80.0, "energy.b": 40.0, "energy.rate": 0.7, "energy.offset": 5.0}
ALL = tuple(TRUE)


def problem(sample, free=ALL, choice="auto", names=None, start=None, **options):
    predictor = ToyPredictor(sample, names)
    return Problem(
        predictor, free, predictor.model.defaults | (start or {}), noise(sample, predictor.names, choice), **options
    )


def test_estimates_agree_with_scipy_and_lie_within_their_intervals(rng):
    p = problem(toy_sample(rng, TRUE))
    found = fit(p)
    theirs = scipy.optimize.least_squares(
        lambda x: p.residuals(dict(zip(ALL, x, strict=True))),
        list(TRUE.values()),
        x_scale=[80, 40, 1, 5],
        ftol=1e-14,
        xtol=1e-14,
    )
    np.testing.assert_allclose([found.values[k] for k in ALL], theirs.x, rtol=1e-4)
    covariance = np.linalg.inv(theirs.jac.T @ theirs.jac)
    widening = max(1.0, 2 * theirs.cost / (800 - 4))
    np.testing.assert_allclose(found.covariance, widening * covariance, rtol=1e-3)
    for path, value in TRUE.items():
        assert abs(found.values[path] - value) < 4 * found.std[path]
    assert found.converged
    assert 0.8 < found.chi2_per_dof < 1.2


def test_widening_goes_by_the_residuals_where_they_contradict_the_stated_noise(rng):
    """Noise stated half of what it is: scipy's covariance times chi-square per degree of freedom, 4 or so."""
    sample = toy_sample(rng, TRUE, noise=2.0)
    understated = {"nominal_stress": 1.0}
    p = problem(sample, choice=understated)
    found = fit(p)
    r, jacobian = p.linearised(found.values)
    level = float(r @ r) / (800 - 4)
    assert level == pytest.approx(4.0, rel=0.2)
    np.testing.assert_allclose(found.covariance, level * np.linalg.inv(jacobian.T @ jacobian), rtol=1e-6)
    assert found.uncertainty.dof == pytest.approx(796, rel=0.01)
    right = fit(problem(sample, choice={"nominal_stress": 2.0}))
    assert right.uncertainty.dof == np.inf
    np.testing.assert_allclose(list(found.std.values()), list(right.std.values()), rtol=0.1)


def test_student_s_quantile_where_the_level_comes_from_few_residuals(rng):
    sample = toy_sample(rng, TRUE, n=7, names=("r1",), recorded=False)
    found = fit(problem(sample, ("energy.a", "energy.b", "energy.offset"), start={"energy.rate": 0.7}))
    assert found.uncertainty.dof == pytest.approx(4, abs=1e-6)
    assert found.uncertainty.quantile() == pytest.approx(2.776, abs=1e-3)  # tables of Student's t, 4 degrees
    low, high = found.intervals["energy.offset"]
    assert high - low == pytest.approx(2 * 2.776 * found.std["energy.offset"], rel=1e-3)
    noise_known = fit(problem(toy_sample(rng, TRUE)))
    assert noise_known.uncertainty.quantile() == pytest.approx(1.95996, abs=1e-5)
    record = noise_known.record()["parameters"]["energy.a"]
    assert record["interval"] == pytest.approx(list(noise_known.intervals["energy.a"]))


def test_the_estimated_level_is_unbiased_with_few_samples():
    """Mean of the squared levels over draws of 7 samples and 3 parameters: the true variance, not 4/7 or 7/4 of it."""
    squares = []
    for trial in range(60):
        sample = toy_sample(np.random.default_rng(trial), TRUE, n=7, names=("r1",), noise=2.0, recorded=False)
        p = problem(sample, ("energy.a", "energy.b", "energy.offset"), start={"energy.rate": 0.7})
        squares.append(fit(p, search=ONCE).problem.noise.std["r1/nominal_stress"] ** 2)
    assert np.mean(squares) == pytest.approx(4.0, rel=0.3)  # chi-square with 4 degrees, mean of 60: 9 %


def correlated_sample(rng, rho, noise, stated, n=400):
    """The curve in two recordings with autoregressive noise."""
    sample = toy_sample(rng, TRUE, noise=0.0, recorded=False, n=n)
    recordings = {}
    for name, r in sample.recordings.items():
        c = r.channels["nominal_stress"]
        e = scipy.signal.lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=n + 300))[300:]
        channel = Channel(c.time, c.values + noise * e, "Pa", stated)
        recordings[name] = Recording(name, "toy", r.inputs, {"nominal_stress": channel}, {})
    return Sample("toy", recordings)


def drawn(make, free, draws):
    """Estimates and standard errors over independent draws, and how often intervals hold the truth."""
    values, std, inside = [], [], []
    for trial in range(draws):
        found = fit(problem(make(np.random.default_rng(trial)), free, start=TRUE), search=ONCE)
        values.append([found.values[k] for k in free])
        std.append([found.std[k] for k in free])
        inside.append([low < TRUE[k] < high for k, (low, high) in found.intervals.items()])
    return np.std(values, axis=0), np.sqrt(np.mean(np.square(std), axis=0)), np.mean(inside)


TWO = ("energy.a", "energy.rate")
SLOWER = [pytest.param(order, corner, marks=pytest.mark.slow) for order, corner in [(2, 0.2), (4, 0.1)]]
CASES = {
    "white": lambda rng: toy_sample(rng, TRUE, n=60),
    "stated half": lambda rng: correlated_sample(rng, 0.0, 2.0, 1.0, n=60),
    "stated double": lambda rng: correlated_sample(rng, 0.0, 0.5, 1.0, n=60),
    "AR 0.9": lambda rng: correlated_sample(rng, 0.9, 1.0, 1.0),
    "AR 0.9, stated half": lambda rng: correlated_sample(rng, 0.9, 2.0, 1.0),
}


def test_what_is_said_of_correlated_residuals_is_what_was_done(rng):
    slow = fit(problem(correlated_sample(rng, 0.9, 1.0, 1.0), TWO, start=TRUE), search=ONCE)
    independent = fit(problem(toy_sample(rng, TRUE), TWO, start=TRUE), search=ONCE)
    times = max(slow.std[k] / independent.std[k] for k in TWO)
    (said,) = [w for w in slow.warnings if "serially correlated" in w]
    assert f"{times:.1f} times larger" in said
    assert 2 < times < 19**0.5
    assert mean_factor(0.6) == pytest.approx(2.0)  # (1 + 0.6) / (1 - 0.6) = 4


@pytest.mark.parametrize(("times", "sought"), [(0.98, False), (1.02, True), (-1.5, False)])
def test_the_shape_of_the_noise_is_sought_where_neighbours_agree_beyond_chance(rng, monkeypatch, times, sought):
    """From 2.5 standard deviations of the correlation of neighbours on, 1 / sqrt(n) each; not where it is negative."""

    class Sought(Exception):
        pass

    def estimate(*args, **options):
        raise Sought

    monkeypatch.setattr(serial_module, "estimate", estimate)
    n, white = 150, rng.normal(size=(2, 150))

    def neighbours(share):
        r = white[0] + share * np.roll(white[0], 1)
        r = r - r.mean()
        return r, r[1:] @ r[:-1] / (r @ r)

    share = scipy.optimize.brentq(lambda s: neighbours(s)[1] - times * 2.5 / np.sqrt(n), -0.99, 0.99)
    posed = problem(toy_sample(rng, TRUE, n=n, names=("r1",)))
    r = 3.0 * neighbours(share)[0] + 7.0  # a mean is not a correlation
    with pytest.raises(Sought) if sought else contextlib.nullcontext():
        assert serial_module.serial(posed, r).parts == ()


def test_noise_stated_too_large_is_said(rng):
    found = fit(problem(correlated_sample(rng, 0.0, 0.5, 1.0), TWO, start=TRUE), search=ONCE)
    assert any("times the recorded noise: check the noise level" in w for w in found.warnings)


@pytest.mark.parametrize("case", list(CASES)[:4])
def test_standard_errors_are_the_scatter_of_the_estimates(case):
    """From both sides: 60 draws know a scatter to 9 %."""
    scatter, std, inside = drawn(CASES[case], TWO, 60)
    np.testing.assert_allclose(std, scatter, rtol=0.27)
    assert 0.88 <= inside <= 1.0


def filtered_sample(rng, order, corner, n=200):
    """The curve in two recordings with noise behind a digital Butterworth filter, its corner over half the rate."""
    low = scipy.signal.butter(order, corner, output="sos")
    size = np.sqrt(np.sum(scipy.signal.sosfilt(low, np.eye(1, 4000)[0]) ** 2))
    sample = toy_sample(rng, TRUE, n=n, noise=0.0)
    for r in sample.recordings.values():
        c = r.channels["nominal_stress"]
        e = scipy.signal.sosfilt(low, rng.normal(size=n + 1000))[-n:] / size
        r.channels["nominal_stress"] = Channel(c.time, c.values + e, "Pa", 1.0)
    return sample


@pytest.mark.parametrize(("order", "corner"), [(1, 0.1), (2, 0.05), *SLOWER])
def test_intervals_hold_behind_a_rig_s_low_pass(order, corner):
    """Too narrow nowhere; at most 1.7 times too wide where the filter has neither of the two shapes."""
    scatter, std, inside = drawn(lambda rng: filtered_sample(rng, order, corner), TWO, 60)
    assert np.all(std > 0.8 * scatter)
    assert np.all(std < (1.7 if (order, corner) in ((2, 0.2), (4, 0.1)) else 1.3) * scatter)
    assert inside > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("order", "corner"), [(1, 0.1), (2, 0.05), (2, 0.2), (4, 0.1)])
def test_intervals_behind_a_low_pass_cover_93_percent_or_more_over_400_draws(order, corner):
    _, _, inside = drawn(lambda rng: filtered_sample(rng, order, corner), TWO, 400)
    assert inside >= 0.93
    if (order, corner) in ((1, 0.1), (2, 0.05)):
        assert inside <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_intervals_cover_95_percent_over_400_draws(case):
    scatter, std, inside = drawn(CASES[case], TWO, 400)
    np.testing.assert_allclose(std, scatter, rtol=0.1)
    assert inside == pytest.approx(0.95, abs=0.02)


def test_noise_that_was_not_recorded_is_estimated(rng):
    found = fit(problem(toy_sample(rng, TRUE, noise=2.5, recorded=False)))
    assert found.problem.noise.std["r1/nominal_stress"] == pytest.approx(2.5, rel=0.1)
    assert any("not recorded" in w for w in found.warnings)


def test_lost_samples_and_priors(rng):
    sample = toy_sample(rng, TRUE, lost=7)
    tight = problem(sample, priors={"energy.offset": (5.0, 1e-4)})
    assert tight.n_samples == 2 * 393
    found = fit(tight)
    assert found.values["energy.offset"] == pytest.approx(5.0, abs=1e-3)
    assert found.std["energy.offset"] == pytest.approx(1e-4, rel=0.3)
    assert found.channels["r1/nominal_stress"].n == 393


def test_a_robust_loss_lets_outliers_be(rng):
    sample = toy_sample(rng, TRUE)
    values = sample.recordings["r1"].channels["nominal_stress"].values
    values[::20] += 300.0
    plain, robust = fit(problem(sample)), fit(problem(sample, loss="cauchy"))
    assert abs(robust.values["energy.rate"] - 0.7) < 0.3 * abs(plain.values["energy.rate"] - 0.7)


@pytest.mark.parametrize("method", ["adam", "lbfgs"])
def test_gradient_methods_find_the_same_minimum(rng, method):
    p = problem(toy_sample(rng, TRUE), ("energy.a", "energy.rate", "energy.offset"), start={"energy.b": 40.0})
    reference, found = fit(p), fit(p, search=Search(method=method, multistart=1))
    assert found.converged
    assert found.chi2 == pytest.approx(reference.chi2, rel=1e-3)


def test_what_is_not_identified_is_said(rng):
    sample = toy_sample(rng, TRUE | {"energy.b": 0.0})
    t = np.asarray(sample.recordings["r1"].inputs["time"])

    class Twins(ToyPredictor):
        """Sees only a + b: both decay alike."""

        def jacobian(self, values, paths):
            merged = dict(values) | {"energy.a": values["energy.a"] + values["energy.b"], "energy.b": 0.0}
            predicted, slopes = super().jacobian(merged, paths)
            slopes["energy.b"] = slopes["energy.a"]
            return predicted, slopes

        def predict(self, values):
            return super().predict(
                dict(values) | {"energy.a": values["energy.a"] + values["energy.b"], "energy.b": values["energy.b"] * 0}
            )

    predictor = Twins(sample)
    p = Problem(
        predictor,
        ("energy.a", "energy.b", "energy.rate"),
        predictor.model.defaults | {"energy.offset": 5.0},
        noise(sample, predictor.names),
    )
    found = fit(p)
    assert len(t)
    assert any(w.startswith("Only a + b is seen") for w in found.warnings)
    assert np.isinf(found.std["energy.a"])
    assert np.isinf(found.std["energy.b"])
    assert np.isfinite(found.std["energy.rate"])


def test_bounds_are_kept_and_reported(rng):
    p = problem(toy_sample(rng, TRUE), start={"energy.rate": 0.3}, bounds={"energy.rate": (0.0, 0.5)})
    found = fit(p)
    assert found.values["energy.rate"] <= 0.5
    assert found.at_bound["energy.rate"] == "upper"
    assert any("upper bound" in w for w in found.warnings)


def test_profile_agrees_with_the_standard_error_of_a_nearly_linear_problem(rng):
    p = problem(toy_sample(rng, TRUE), ("energy.a", "energy.rate"), start={"energy.b": 40.0, "energy.offset": 5.0})
    found = fit(p)
    check_profile(found, 1.96)


def check_profile(found, quantile):
    """Both ends a quantile of standard errors from the estimate, to 3 % of that distance."""
    scan = profile(found, "energy.a")
    centre, std = found.values["energy.a"], found.std["energy.a"]
    assert centre - scan.interval[0] == pytest.approx(quantile * std, rel=0.03)
    assert scan.interval[1] - centre == pytest.approx(quantile * std, rel=0.03)
    assert scan.rise.min() >= -1e-3


def test_profile_and_covariance_agree_where_the_noise_is_not_as_stated(rng):
    start = {"energy.b": 40.0, "energy.offset": 5.0}
    half = correlated_sample(rng, 0.0, 2.0, 1.0)
    check_profile(fit(problem(half, TWO, start=start)), 1.963)
    slow = fit(problem(correlated_sample(rng, 0.9, 1.0, 1.0), TWO, start=start))
    assert np.all(slow.uncertainty.inflation > 4)  # (1 + rho) / (1 - rho) = 19 at most
    check_profile(slow, slow.uncertainty.quantile())
    few = fit(problem(toy_sample(rng, TRUE, n=8, names=("r1",), recorded=False, noise=0.1), TWO, start=start))
    assert few.uncertainty.dof == pytest.approx(6)
    check_profile(few, 2.447)  # Student's t, 6 degrees


def test_holdout_is_scored_but_not_fitted(rng):
    sample = toy_sample(rng, TRUE)
    p = problem(sample, names=("r1",))
    found = fit(p, holdout=("r2",))
    assert set(found.channels) == {"r1/nominal_stress"}
    assert set(found.holdout) == {"r2/nominal_stress"}
    assert found.holdout["r2/nominal_stress"].chi2_per_sample < 1.5


def test_one_descent_calls_the_model_once_a_step(rng):
    p = problem(toy_sample(rng, TRUE))
    p.predictor.calls = 0
    end = descend(p)
    assert p.predictor.calls == end.runs


def test_trace_descends(rng):
    chi2 = [i.chi2 for i in fit(problem(toy_sample(rng, TRUE))).trace]
    assert all(b <= a * (1 + 1e-12) for a, b in zip(chi2, chi2[1:], strict=False))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"free": ("energy.aa",)}, "unknown free parameter 'energy.aa'. Did you mean"),
        ({"free": ()}, "no parameter is free"),
        ({"free": ("energy.a", "energy.a")}, "listed twice"),
        ({"bounds": {"energy.rate": (3.0, 1.0)}}, "lower must be below upper"),
        ({"bounds": {"energy.rate": (2.0, 3.0)}}, "start of energy.rate = 1.0"),
        ({"priors": {"energy.a": (1.0, 0.0)}}, "must be positive"),
        ({"loss": "huber"}, "unknown loss 'huber'"),
    ],
)
def test_refusals(rng, change, words):
    with pytest.raises(InputError) as caught:
        problem(toy_sample(rng, TRUE, n=10), **change)
    assert words in str(caught.value)


def test_too_few_samples_are_refused(rng):
    with pytest.raises(InputError, match="3 samples can't determine 4 parameters"):
        problem(toy_sample(rng, TRUE, n=3, names=("r1",)))


def test_a_search_cut_short_says_so(rng):
    found = fit(problem(toy_sample(rng, TRUE)), search=Search(multistart=1, max_steps=2))
    assert not found.converged
    assert "no convergence after" in found.warnings[0]
    with pytest.raises(NotConverged, match="no convergence"):
        required(found)


def test_a_model_without_finite_prediction_at_the_start_is_refused(rng):
    p = problem(toy_sample(rng, TRUE))
    p.predictor.predict = lambda values: {
        n: p.predictor._recording(n, curve(values, p.predictor._time(n)) * np.nan) for n in p.predictor.names
    }
    with pytest.raises(InputError, match="no finite prediction at the start"):
        fit(p)


def test_a_modulus_that_is_not_linear_is_searched_with_the_rest(rng):
    class Bent(ToyPredictor):
        """a enters squared, so it can't be solved for linearly."""

        def _bent(self, values):
            return dict(values) | {"energy.a": values["energy.a"] ** 2 / 80.0}

        def predict(self, values):
            return super().predict(self._bent(values))

        def jacobian(self, values, paths):
            predicted, slopes = super().jacobian(self._bent(values), paths)
            if "energy.a" in slopes:
                factor = 2 * values["energy.a"] / 80.0
                slopes["energy.a"] = {
                    name: {c: factor * s for c, s in by.items()} for name, by in slopes["energy.a"].items()
                }
            return predicted, slopes

    sample = toy_sample(rng, TRUE)
    straight, bent = ToyPredictor(sample), Bent(sample)
    level, start = noise(sample, straight.names), straight.model.defaults
    reference = fit(Problem(straight, ALL, start, level))
    found = fit(Problem(bent, ALL, start, level))
    assert found.chi2 == pytest.approx(reference.chi2, rel=1e-6)
    assert found.values["energy.a"] ** 2 / 80 == pytest.approx(reference.values["energy.a"], rel=0.05)

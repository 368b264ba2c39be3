"""The fitting room on a predictor in closed form: estimates, errors, intervals, methods, refusals."""

import numpy as np
import pytest
import scipy.optimize
from toy import ToyPredictor, curve, toy_sample

from tissuejax.errors import InputError, NotConverged
from tissuejax.fitting.least_squares import descend, fit, required
from tissuejax.fitting.problem import Problem
from tissuejax.fitting.profile import profile
from tissuejax.fitting.weights import noise

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


def test_standard_errors_cover_the_truth_as_often_as_they_say(rng):
    inside = []
    for _ in range(60):
        p = problem(
            toy_sample(rng, TRUE, n=60), ("energy.a", "energy.rate"), start={"energy.b": 40.0, "energy.offset": 5.0}
        )
        found = fit(p, multistart=1)
        inside += [abs(found.values[k] - TRUE[k]) < 1.96 * found.std[k] for k in p.free]
    assert 0.87 <= np.mean(inside) <= 1.0  # 95 % of 120, three standard deviations of the count


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
    reference, found = fit(p), fit(p, method=method, multistart=1)
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
    scan = profile(found, "energy.a")
    centre, std = found.values["energy.a"], found.std["energy.a"]
    assert scan.interval == pytest.approx((centre - 1.96 * std, centre + 1.96 * std), rel=0.02)
    assert scan.rise.min() >= -1e-3


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
    assert p.predictor.calls == end.n_evaluations


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
    found = fit(problem(toy_sample(rng, TRUE)), multistart=1, max_steps=2)
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

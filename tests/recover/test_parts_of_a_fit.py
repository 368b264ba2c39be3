"""The small rules that a fit is made of, each against its formula, scipy, or what it must do with known numbers."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from toy import ToyPredictor, toy_sample

from tissuejax.estimation.losses import soften
from tissuejax.estimation.numerical import changes
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.weights import Weights, noise
from tissuejax.experiments.probing_settings import REFINED, ProbingSettings
from tissuejax.fitting.cut_resolution import resolution
from tissuejax.fitting.gradient_descent import gradient_descent
from tissuejax.fitting.least_squares import fit
from tissuejax.fitting.memory import begun_loaded
from tissuejax.fitting.options import Search
from tissuejax.fitting.profile import profile
from tissuejax.fitting.separable import Projection
from tissuejax.recordings.recording import Channel, Recording, Sample

TRUE = {"energy.a": 80.0, "energy.b": 40.0, "energy.rate": 0.7, "energy.offset": 5.0}


def problem(sample, free, **options):
    predictor = ToyPredictor(sample)
    return Problem(predictor, free, predictor.model.defaults | TRUE, noise(sample, predictor.names, "auto"), **options)


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


@pytest.mark.parametrize(("method", "steps"), [("adam", 30), ("lbfgs", 3)])
def test_a_gradient_method_takes_as_many_steps_as_it_says(rng, method, steps):
    p = problem(toy_sample(rng, TRUE), ("energy.a", "energy.rate"))
    p = dataclasses.replace(p, start=p.start | {"energy.a": 20.0, "energy.rate": 0.1})
    taken = []
    ended = gradient_descent(
        p, p.box.free(p.vector(p.start)), method, max_steps=3, tolerance=1e-9, on_accept=lambda n, *_: taken.append(n)
    )
    assert ended.runs == steps
    assert taken[-1] == steps


def test_numbers_in_the_sentences_on_a_cut_s_resolution():
    """Strength from which the flats part the tissue, 2 G / b; the element that suits both, where tau_h = 2 G / b."""
    G, b, h = 3.0, 5e-4, 5e-4  # not 2: its double is its square
    said = resolution(1e4, G, 1564.0, 2e4, b, h, 0.02, 0.005).sentences
    (both,) = [s for s in said if "no strength suits both" in s]
    assert f"at least {2 * G / b:.4g} Pa" in both
    plane = 4 * 1564.0 * (2e4 + 1564.0 / 3) / (2e4 + 4 * 1564.0 / 3)
    size = float(both.split("elements of ")[1].split(" mm")[0]) * 1e-3
    assert np.sqrt(9 * np.pi * plane * G / (32 * 3 * size)) == pytest.approx(2 * G / b, rel=5e-3)
    thin = resolution(4000.0, G, 1564.0, 2e4, b, 1e-5, 0.02, 0.005).sentences
    assert any(f"A strength above {2 * G / b:.4g} Pa parts it" in s for s in thin)

"""What a fit says of itself, put together by hand: each entry of result.json against the piece that it comes from."""

import json
import platform
import re
from dataclasses import FrozenInstanceError
from importlib import metadata
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from tissuejax.cache import source
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Volumetric
from tissuejax.estimation.covariance import Uncertainty
from tissuejax.estimation.ending import Ending
from tissuejax.fitting import result
from tissuejax.fitting.first import First
from tissuejax.fitting.result import Fit, Iterate, described, versions
from tissuejax.fitting.scores import Score
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Recording

DECLARED = {
    "energy.mu": Parameter("mu", "Pa", 100.0, lower=0.0),
    "energy.n": Parameter("n", "1", 2.0),
    "effects.slow.g": Parameter("g", "1", 0.0, 0.0, 1.0),
}
VALUES = {"energy.mu": 300.0, "energy.n": np.float64(2.5), "effects.slow.g": 0.25}
FREE = ("effects.slow.g", "energy.mu")
STD = np.array([0.5, 20.0])
BOUNDS = {"effects.slow.g": (0.0, 1.0), "energy.mu": (290.0, 1e4)}
SCORE = Score(1.0, "Pa", 2.0, 3, 0.5, 0.1)


def scalar(values: dict) -> Any:
    """What has this initial shear modulus: mu (1 + n)."""
    return values["mu"] * (1 + values["n"])


SLOW = SimpleNamespace(name="slow", long_term=lambda p: 1 - p["g"] ** 2)
PLAIN = SimpleNamespace(name="plain")


def fit(n=20, priors=(), effects: Any = (PLAIN, SLOW), correlation=None, dof=7.0, **more) -> Any:
    """A fit of one recording that was simulated and one that was not."""
    energy = SimpleNamespace(name="made", order=3, formula="W", source="none", initial_shear_modulus=scalar)
    model = SimpleNamespace(parameters=DECLARED, energy=energy, effects=effects, volumetric=None)
    predictor = SimpleNamespace(model=model, sample=SimpleNamespace(name="liver"), names=("r1", "r2"))
    noise = SimpleNamespace(std={"r1/force": 0.5, "r2/force": 2.0}, groups={"r2/force": "N"})
    problem = SimpleNamespace(
        predictor=predictor, free=FREE, bound=BOUNDS.get, n_samples=n, priors=dict.fromkeys(priors), noise=noise
    )
    matrix = np.array([[1.0, 0.6], [0.6, 1.0]])
    spread = Uncertainty(STD, matrix * np.outer(STD, STD), matrix, 12.5, ("Only mu.",), dof=dof)
    told: dict[str, Any] = {
        "problem": problem,
        "status": "converged",
        "values": VALUES,
        "uncertainty": spread,
        "at_bound": {"energy.mu": "lower"},
        "chi2": 36.0,
        "channels": {"r1/force": SCORE},
        "holdout": {"r3/force": SCORE},
        "predictions": {"r1": Recording("r1", "probing", {}, {}, {"numerics/kinetic": np.float64(0.125), "start": 0})},
        "trace": [Iterate(3, 50.0, {"energy.mu": 200.0})],
        "stability": SimpleNamespace(paths={"uniaxial": SimpleNamespace(ranges=((0.5, 0.9), (1.0, 2.0)))}),
        "starts": [36.0, 40.0],
        "n_evaluations": 17,
        "seconds": 1.5,
    }
    return Fit(**(told | more))


@pytest.fixture(autouse=True)
def known(monkeypatch):
    monkeypatch.setattr(result, "fingerprint", lambda problem: f"of {problem.n_samples}")
    monkeypatch.setattr(result, "versions", lambda: {"python": "3"})


def test_the_record_has_every_piece_in_its_place():
    """An interval is Student's of seven degrees of freedom, cut at the bounds; what is held has none."""
    q = student.ppf(0.975, 7)
    told = fit().record()
    assert json.loads(json.dumps(told)) == told
    parameters = told.pop("parameters")
    assert list(parameters) == list(VALUES)
    mu, n, g = parameters.values()
    assert mu.pop("interval") == pytest.approx([290.0, 300 + 20 * q], rel=1e-9)
    assert g.pop("interval") == [0.0, 1.0]
    assert mu == {"value": 300.0, "std": 20.0, "unit": "Pa", "at_bound": "lower", "free": True}
    assert n == {"value": 2.5, "std": None, "interval": None, "unit": "1", "at_bound": None, "free": False}
    assert g == {"value": 0.25, "std": 0.5, "unit": "1", "at_bound": None, "free": True}
    assert told == {
        "format": 1,
        "status": "converged",
        "sample": "liver",
        "energy": {
            "name": "made-3",
            "formula": "W",
            "forms": {"volumetric": "incompressible"},
            "volumetric": None,
            "source": "none",
        },
        "effects": ["plain", "slow"],
        "method": "levenberg-marquardt",
        "recordings": ["r1", "r2"],
        "data": "of 20",
        "correlation": {"paths": list(FREE), "matrix": [[1.0, 0.6], [0.6, 1.0]]},
        "condition_number": 12.5,
        "shear_modulus": {"instantaneous": 1050.0, "long_term": 1050.0 * 0.9375},
        "interval": {"confidence": 0.95, "degrees_of_freedom": 7.0},
        "not_identified": ["Only mu."],
        "chi2": 36.0,
        "chi2_per_dof": 2.0,
        "noise": {"r1/force": {"std": 0.5, "estimated": False}, "r2/force": {"std": 2.0, "estimated": True}},
        "stable_between": {"uniaxial": [[0.5, 0.9], [1.0, 2.0]]},
        "channels": {"r1/force": SCORE.record()},
        "holdout": {"r3/force": SCORE.record()},
        "numerics": {"r1": {"kinetic": 0.125}},
        "warnings": [],
        "starts": [36.0, 40.0],
        "n_evaluations": 17,
        "seconds": 1.5,
        "trace": [{"n_evaluations": 3, "chi2": 50.0, "values": {"energy.mu": 200.0}}],
        "versions": {"python": "3"},
    }


def test_what_a_fit_does_not_have_is_not_in_its_record():
    bare = fit(effects=(PLAIN,), predictions={}, trace=[], channels={}, holdout={})
    told = bare.record()
    assert (bare.shear_moduli, bare.numerics, bare.curve_std, bare.first) == ({}, {}, {}, None)
    assert not {"shear_modulus", "sites", "first", "numerics"} & set(told)
    assert (told["channels"], told["holdout"], told["trace"]) == ({}, {}, [])


def test_what_a_fit_of_probings_has_more_is_in_its_record():
    sites = {"r1": {"markers": {"before": 2e-3, "after": 1e-3}}}
    first = First({"energy.mu": 250.0}, 1.5, ("r1",), {"r2": "too deep"}, {"before": 2.0, "after": 1.0}, 9)
    told = fit(sites=sites, first=first, warnings=["Look."], method="adam").record()
    assert told["sites"] == sites
    assert told["first"] == first.record()
    assert (told["warnings"], told["method"]) == (["Look."], "adam")


@pytest.mark.parametrize(
    ("n", "priors", "dof"), [(20, (), 18), (20, "abc", 21), (4, (), 2), (3, (), 1), (2, (), 1), (2, "a", 1)]
)
def test_chi_square_is_shared_by_samples_and_priors_less_what_was_estimated(n, priors, dof):
    """At least one."""
    assert fit(n, priors).chi2_per_dof == pytest.approx(36.0 / dof, rel=1e-12)


@pytest.mark.parametrize("status", [*Ending, "converged", "no convergence in 200 evaluations"])
def test_only_one_ending_is_convergence(status):
    assert fit(status=status).converged == (str(status) == "converged")


def test_estimates_come_with_errors_limits_and_matrices_in_the_order_of_the_free():
    of = fit(dof=4.0)
    assert of.free == FREE
    assert of.std == {"effects.slow.g": 0.5, "energy.mu": 20.0}
    assert all(type(s) is float for s in of.std.values())
    assert of.freedom == 4.0
    assert of.limits("energy.mu") == (290.0, 1e4, False)
    np.testing.assert_array_equal(of.correlation, [[1.0, 0.6], [0.6, 1.0]])
    np.testing.assert_array_equal(of.covariance, [[0.25, 6.0], [6.0, 400.0]])
    of.problem.free = (*FREE, "energy.n")
    with pytest.raises(ValueError, match="zip"):
        _ = of.std


def test_moduli_are_those_of_the_first_effect_that_relaxes():
    fast = SimpleNamespace(name="fast", long_term=lambda p: 0.5)
    assert fit(effects=(fast, SLOW)).shear_moduli == {"instantaneous": 1050.0, "long_term": 525.0}
    assert fit(effects=()).shear_moduli == {}


def test_every_simulated_recording_tells_its_checks():
    made = {
        name: Recording(name, "probing", {}, {}, {f"numerics/{check}": share, "radius": 9.0})
        for name, check, share in (("a", "hourglass", 0.01), ("b", "corner", -0.5))
    } | {"c": Recording("c", "probing", {}, {}, {"radius": 9.0})}
    assert fit(predictions=made).numerics == {"a": {"hourglass": 0.01}, "b": {"corner": -0.5}}


def test_a_fit_is_one_object_and_stays_as_it_is():
    of = fit()
    assert of in [of]
    assert of != fit()
    assert len({of, fit()}) == 2
    with pytest.raises(FrozenInstanceError):
        of.chi2 = 1.0
    with pytest.raises(FrozenInstanceError):
        of.trace[0].chi2 = 1.0
    other = fit()
    for name in ("warnings", "sites", "curve_std"):  # nothing is shared between fits
        assert getattr(of, name) is not getattr(other, name)


def test_an_energy_is_described_with_its_forms():
    energy = ReducedPolynomial(order=2)
    told = described(SimpleNamespace(energy=energy, volumetric=None))  # pyright: ignore[reportArgumentType]
    assert told["name"] == "reduced-polynomial-2"
    assert (told["formula"], told["source"]) == (energy.formula, energy.source)
    assert (told["volumetric"], told["forms"]) == (None, {"volumetric": "incompressible"})
    kind: Any = next(cls for cls in Volumetric.__subclasses__() if cls.formula)
    pair: Any = SimpleNamespace(energy=NeoHookean(), volumetric=kind())
    told = described(pair)
    assert (told["name"], told["volumetric"]) == ("neo-hookean", kind.name)
    assert told["forms"] == {"volumetric": kind.formula}


def test_versions_are_those_installed_and_what_is_missing_is_said(monkeypatch):
    told = versions()
    names = ("tissuejax", "jax", "optimistix", "optax", "diffrax", "numpy", "scipy")
    assert list(told) == ["python", "float", *names, "source"]
    assert told["python"] == platform.python_version()
    assert told["float"] == "float64"
    assert told["source"] == source.LOADED
    assert (told["numpy"], told["scipy"]) == (metadata.version("numpy"), metadata.version("scipy"))
    assert re.match(r"\d+\.\d+", told["jax"])

    def version(name):
        if name == "optax":
            raise metadata.PackageNotFoundError(name)
        return f"{name} 1"

    assert result._installed() is result._installed()  # read once
    monkeypatch.setattr(metadata, "version", version)
    anew = result._installed.__wrapped__()
    assert anew == {name: f"{name} 1" for name in names} | {"optax": "not installed"}

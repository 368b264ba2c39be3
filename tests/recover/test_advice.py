"""What is said of a fit: silence on one side of each limit, one sentence with the right numbers on the other."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from toy import ToyPredictor, toy_sample

from tissuejax.estimation.problem import Problem
from tissuejax.estimation.weights import noise
from tissuejax.fitting.advice import warnings_of
from tissuejax.fitting.scores import Score

KEY = "r1/nominal_stress"
FINE = Score(rmse=1.0, unit="Pa", chi2_per_sample=1.0, n=100, r2=0.99, autocorrelation=0.0)


def said_of(sample, **what):
    """Warnings of a fit that is as it should be but for `what`."""
    uncertainty = {"sentences": [], "condition": 10.0, "dof": np.inf, "inflation": None, "serial": False}
    uncertainty = {k: what.pop(k, v) for k, v in uncertainty.items()}
    channels = {KEY: dataclasses.replace(FINE, **what.pop("score", {}))}
    found = {"converged": True, "at_bound": {}, "holdout": {}, "numerics": {}, "starts": [9.0], "channels": channels}
    predictor = ToyPredictor(sample)
    start = predictor.model.defaults
    posed = Problem(predictor, ("energy.a", "energy.rate"), start, noise(sample, predictor.names, "auto"))
    found |= {"problem": posed, "free": posed.free, "values": start}
    stability = SimpleNamespace(paths={})
    return warnings_of(SimpleNamespace(uncertainty=SimpleNamespace(**uncertainty), stability=stability, **found | what))


def held_out(chi2):
    return {"r2/nominal_stress": dataclasses.replace(FINE, chi2_per_sample=chi2)}


@pytest.mark.parametrize(
    ("quiet", "loud", "words"),
    [
        ({"starts": [100.0, 100.09, 200.0]}, {"starts": [100.0, 100.11, np.nan]}, "Only 1 of 3 starts"),
        ({"starts": [100.0]}, {"starts": [100.0, np.nan]}, "Only 1 of 2 starts"),
        ({"starts": [np.nan, np.nan]}, {"starts": [np.nan, 100.0]}, "Only 1 of 2 starts"),
        ({}, {"at_bound": {"energy.rate": "lower"}}, "energy.rate ended at its lower bound (0 1/s)"),
        ({}, {"at_bound": {"energy.rate": "upper"}}, "energy.rate ended at its upper bound (20 1/s)"),
        ({"condition": 0.9e6}, {"condition": 1.1e6}, "condition number is 1.1e+06"),
        ({"numerics": {"p": {"inertia": 0.04}}}, {"numerics": {"p": {"inertia": 0.06}}}, "p 6% of the strain energy"),
        ({}, {"numerics": {k: {"hourglass": v} for k, v in zip("pqs", (0.1, 0.3, 0.2))}}, "simulation of q 30% of"),
        ({"holdout": held_out(3.9)}, {"holdout": held_out(4.1)}, "predicted 2.0 times worse"),
        (
            {"holdout": held_out(3.9), "score": {"chi2_per_sample": 0.25}},  # better than the noise is no reason
            {"holdout": held_out(9.0), "score": {"chi2_per_sample": 0.25}},
            "predicted 6.0 times worse",
        ),
        (
            {"holdout": held_out(5.5), "score": {"chi2_per_sample": 1.44}},
            {"holdout": held_out(5.9), "score": {"chi2_per_sample": 1.44}},
            "predicted 2.0 times worse",
        ),
        (
            {"score": {"chi2_per_sample": 1.49}},
            {"score": {"chi2_per_sample": 4.0, "rmse": 40.0, "autocorrelation": 0.21}},
            "(r1/nominal_stress 2.0 times): the model lacks something.",
        ),
        (
            {"score": {"chi2_per_sample": 1.49}},
            {"score": {"chi2_per_sample": 4.0, "rmse": 40.0, "autocorrelation": 0.19}},  # of 100 samples, by chance
            "(r1/nominal_stress 2.0 times): what is left scatters from sample to sample, which missing physics does "
            "not: check the noise level.",
        ),
        (
            {"score": {"chi2_per_sample": 1.49}},
            {"score": {"chi2_per_sample": 4.0, "rmse": 40.0, "n": 29}},  # so few can't tell
            "(r1/nominal_stress 2.0 times): the model lacks something.",
        ),
        (
            {"score": {"chi2_per_sample": 1.49}},
            {"score": {"chi2_per_sample": 1.51, "rmse": 1e-6}},
            "(r1/nominal_stress 1.2 times): by less than",
        ),
        (
            {"score": {"chi2_per_sample": 0.25}},  # stated, and not contradicted by the residuals
            {"score": {"chi2_per_sample": 0.25}, "dof": 96.0},
            "only 0.50 times the recorded noise",
        ),
        (
            {"score": {"autocorrelation": 0.49}},
            {"score": {"autocorrelation": 0.6}},
            "too small, by up to about 2.0 times",  # sqrt(1.6 / 0.4)
        ),
        (
            {},
            {"score": {"autocorrelation": 0.6}, "serial": True, "inflation": np.array([2.25, 9.0, 4.0])},
            "up to 3.0 times larger",
        ),
    ],
)  # fmt: skip
def test_what_is_said_of_a_fit_from_both_sides_of_its_limit(rng, quiet, loud, words):
    sample = toy_sample(rng, ToyPredictor.model.defaults, n=10)
    assert said_of(sample, **quiet) == []
    (said,) = said_of(sample, **loud)
    assert words in said

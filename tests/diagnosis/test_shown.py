"""The fit beside a name is the model as near as it comes to the recordings, whatever its law errs by.

A specimen relaxes by a power of time, which no Prony series is: what a diagnosis shows is held against scipy's least
squares of the same law, written out here.
"""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

import tissuejax as tj
from tissuejax.recordings.recording import Channel, Recording, Sample

NOISE = 3.0  # Pa


def ramp_and_hold(top: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of the samples, and of what is convolved: closely along the ramp, where the elastic stress changes, s."""
    reached = top / speed
    time = np.concatenate([np.linspace(0, reached, 30, endpoint=False), reached + np.geomspace(0.02, 60, 60)])
    return time, np.linspace(0, reached, 2001)


def stress(relaxed, modulus: float, top: float, speed: float) -> np.ndarray:
    """P(t) = int G(t - s) dP_e(s), P_e = modulus (x - x^-2), with the relaxation function G(t) = 1 - relaxed(t)."""
    time, fine = ramp_and_hold(top, speed)
    x = 1 + speed * fine
    steps, middle = np.diff(modulus * (x - x**-2)), 0.5 * (fine[1:] + fine[:-1])
    since = time[:, None] - middle
    return np.where(since > 0, 1 - relaxed(np.maximum(since, 0.0)), 0.0) @ steps


def recording(name: str, top: float, speed: float, power: float, start: float, rng) -> Recording:
    time, _ = ramp_and_hold(top, speed)
    measured = stress(lambda t: 1 - (1 + t / start) ** -power, 1200.0, top, speed) + rng.normal(0, NOISE, len(time))
    drives = {"time": time, "stretch": 1 + np.minimum(speed * time, top)}
    return Recording(name, "uniaxial", drives, {"nominal_stress": Channel(time, measured, "Pa", NOISE)})


@pytest.mark.slow
def test_what_is_shown_comes_as_near_as_a_plain_fit_of_the_same_law():
    """Under the whole discrepancy parameters settled where it took most of the stress: 65 % of the misfit was removed,
    and beside the same name 99 % can be."""
    rng, (top, speed, start, power) = np.random.default_rng(2), (0.3, 1.0, 0.05, 0.25)
    paths = {"fitted": (top, speed), "other": (0.8 * top, 0.3 * speed)}
    sample = Sample("s", {n: recording(n, *p, power, start, rng) for n, p in paths.items()})
    found = tj.diagnose(sample, "neo-hookean", holdout=["other"])
    (effect,) = found.as_dict()["effects"]
    assert effect["name"] == "viscoelasticity"
    terms = sum(p.rpartition(".")[2].startswith("tau") for p in found.answered.chosen.values)
    measured = {n: r.channels["nominal_stress"].values for n, r in sample.recordings.items()}

    def missed(name: str, p: np.ndarray) -> np.ndarray:
        share, tau = p[1 : 1 + terms], np.exp(p[1 + terms :])
        return stress(lambda t: (1 - np.exp(-t[..., None] / tau)) @ share, p[0], *paths[name]) - measured[name]

    begin = np.array([1000.0, *np.full(terms, 0.8 / terms), *np.log(np.geomspace(0.1, 10, terms))])
    bounds = [0, *np.zeros(terms), *np.full(terms, -7)], [np.inf, *np.ones(terms), *np.full(terms, 7)]
    plain = least_squares(lambda p: missed("fitted", p), begin, x_scale=np.abs(begin) + 0.1, bounds=bounds).x
    shown = found.as_dict()["after"]
    for name, factor in (("fitted", 1.02), ("other", 1.2)):
        rms = float(np.sqrt(np.mean(missed(name, plain) ** 2)))
        assert shown[name]["nominal_stress"]["rmse"] < factor * rms
    # and what is said to be left is what that fit leaves: 22 Pa were said where 1.4 lie between curve and points
    left = np.concatenate([missed(name, plain) for name in paths])
    beyond = math.sqrt(np.mean(left**2) - NOISE**2)
    assert 0.5 * beyond < found.answered.rest()["rms"] < 2 * beyond

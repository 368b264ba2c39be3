"""What simpler ways of answering would have said: single criteria, all subsets, and a Gaussian process.

The single criteria are read off the `candidates` and `sets` of a result, so that they see exactly the same fits.
"""

import math
import time
import warnings
from dataclasses import dataclass

import h5py
import numpy as np
from jaxtyping import Float
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strengths import columns

Answer = tuple[tuple[str, ...], float]
"""Names, and chi-square per sample on the held-out recording once they are refitted."""


def by_score(result: dict, least: float = 12.0) -> Answer:
    """Score ranking alone: the candidate of largest linear gain, if it beats `least`; no refit, no abstention."""
    best = max(_with(result, "score"), key=lambda c: c["score"], default=None)
    return _answer(result, best if best and best["score"] > least else None)


def by_refit(result: dict, least: float = 8.0) -> Answer:
    """Refit alone: the single candidate whose refit fits best in sample, if it lowers the criterion by `least`."""
    best = min(_with(result, "refit_chi2_per_sample"), key=lambda c: c["refit_chi2_per_sample"], default=None)
    return _answer(result, best if best and (best.get("criterion") or 0.0) < -least else None)


def by_hold_out(result: dict) -> Answer:
    """Hold-out alone: the single candidate with the smallest held-out error, if smaller than the base model's."""
    key = "held_out_chi2_per_sample"
    best = min(_with(result, key), key=lambda c: c[key], default=None)
    return _answer(result, best if best and best[key] < held_out_before(result) else None)


def by_all_subsets(result: dict) -> Answer:
    """The set of smallest Schwarz criterion on the fitted recordings among all refitted; no hold-out, no verdict."""
    finite = [
        s for s in result.get("sets", ()) if s["information_criterion"] is not None
    ]  # a refit may have broken down
    best = min(finite, key=lambda s: s["information_criterion"], default=None)
    if best is None or not best["effects"]:
        return (), held_out_before(result)
    return tuple(dict.fromkeys(key.split("/")[0] for key in best["effects"])), _held(best)


def _with(result: dict, key: str) -> list[dict]:
    return [c for c in result["candidates"] if c.get(key) is not None]


def _answer(result: dict, candidate: dict | None) -> Answer:
    if candidate is None:
        return (), held_out_before(result)
    return (candidate["name"],), _held(candidate)


def _held(found: dict) -> float:
    value = found.get("held_out_chi2_per_sample")
    return math.nan if value is None else value


def held_out_before(result: dict) -> float:
    """Chi-square per sample of the base model on the held-out recordings; infinite where none were held out."""
    found = [c["chi2_per_sample"] for r in result["before"].values() for c in r.values() if c.get("role") == "held out"]
    return float(np.mean(found)) if found else math.inf


@dataclass(frozen=True)
class Process:
    """A Gaussian-process discrepancy on one case.

    Attributes:
        fitted, held_out: chi-square per sample with the discrepancy added to the refitted base.
        base_held_out: without it.
        seconds: cost.
    """

    fitted: float
    held_out: float
    base_held_out: float
    seconds: float


def trials_of(path) -> tuple[list[Trial], dict[str, np.ndarray], float]:
    """Recordings of a case file (not its key): what was done, what was measured, noise (1 if not stated)."""
    trials, stress, noise = [], {}, 1.0
    with h5py.File(path) as file:
        for name, g in file["recordings"].items():
            kind = g.attrs["experiment"]
            drive = g["shear" if kind == "simple-shear" else "stretch"][()]
            sizes = (float(g.attrs[k]) for k in ("start", "area", "height", "diameter"))
            trials.append(Trial(name, kind, g["time"][()], drive, g["direction"][()], *sizes))
            stress[name] = g["nominal_stress"][()]
            noise = float(g["nominal_stress"].attrs.get("noise_std", noise))
    return trials, stress, noise


def discrepancy(path, energy: str, most: int = 400, seed: int = 0) -> Process:
    """Refit the base, then a Gaussian process of the residual over (stretch, rate, time), as Kennedy and O'Hagan 2001.

    It can predict, but it names nothing. Inputs are scaled to unit spread; at most `most` samples train it.

    Args:
        path: a case file of material tests.
        energy: base model told.
    """
    begun = time.perf_counter()
    trials, stress, noise = trials_of(path)
    fitted = trials[:-1]
    A = np.stack(columns(energy, fitted), -1)
    y = np.concatenate([stress[t.name].ravel() for t in fitted])
    best = np.linalg.lstsq(A, y, rcond=None)[0]
    residual = (y - A @ best) / noise
    X, X_held = np.concatenate([_inputs(t) for t in fitted]), _inputs(trials[-1])
    middle, spread = X.mean(0), X.std(0) + 1e-12
    rows = np.random.default_rng(seed).choice(len(X), min(most, len(X)), replace=False)
    kernel = ConstantKernel(10.0, (1e-2, 1e5)) * RBF([1.0] * X.shape[1], (0.05, 50)) + WhiteKernel(1.0, (0.5, 2.0))
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit((X[rows] - middle) / spread, residual[rows])
    base = np.stack(columns(energy, trials[-1:]), -1) @ best
    left = (stress[trials[-1].name].ravel() - base) / noise
    inside = residual - process.predict((X - middle) / spread)
    outside = left - process.predict((X_held - middle) / spread)
    return Process(
        float(np.mean(inside**2)),
        float(np.mean(outside**2)),
        float(np.mean(left**2)),
        time.perf_counter() - begun,
    )


def _inputs(trial: Trial) -> Float[np.ndarray, "m 4"]:
    """Stretch (or shear), its rate, time, and the kind of test as a number; one row a stress value."""
    drive = trial.drive if trial.drive.ndim == 2 else trial.drive[:, None]
    rate = np.gradient(drive, trial.time, axis=0)
    kind = ("uniaxial", "planar", "equibiaxial", "biaxial", "simple-shear").index(trial.kind)
    columns_ = [drive, rate, np.broadcast_to(trial.time[:, None], drive.shape), np.full(drive.shape, float(kind))]
    return np.stack([c.ravel() for c in columns_], -1)

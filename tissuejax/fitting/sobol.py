"""Sobol indices: how much of a channel's variance each parameter explains over whole ranges, alone and with the
others (SALib).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError, unknown
from tissuejax.experiments.predictor import Predictor

SHOWN_TIMES = 12  # samples of a channel that are analysed
BATCH = 256


@dataclass(frozen=True)
class Sobol:
    """Indices by channel.

    Attributes:
        paths: parameters varied.
        ranges: over which.
        first: by "recording/channel", share of the variance due to each parameter alone, weighted over time by
            variance.
        total: the same with all interactions.
        n: predictions made.
        failed: share of predictions that were not finite (outside the energy's valid range), replaced by the mean.
    """

    paths: tuple[str, ...]
    ranges: dict[str, tuple[float, float]]
    first: dict[str, Float[np.ndarray, " p"]]
    total: dict[str, Float[np.ndarray, " p"]]
    n: int
    failed: float

    def record(self) -> dict:
        """As plain data."""
        return {
            "ranges": {p: list(r) for p, r in self.ranges.items()},
            "first": {k: dict(zip(self.paths, map(float, v), strict=True)) for k, v in self.first.items()},
            "total": {k: dict(zip(self.paths, map(float, v), strict=True)) for k, v in self.total.items()},
            "n": self.n,
            "failed": self.failed,
        }


def sobol(
    predictor: Predictor,
    values: Mapping[str, float],
    ranges: Mapping[str, tuple[float, float]],
    *,
    n: int = 256,
    seed: int = 0,
    batched: bool = True,
) -> Sobol:
    """First-order and total Sobol indices of every channel.

    Args:
        predictor: model and recordings.
        values: all parameters; those in `ranges` are varied uniformly, the others stay.
        ranges: (low, high) by path, SI.
        n: base samples, a power of two; n (p + 2) predictions are made.
        seed: of the scrambled sequence.
        batched: predict many at once (material tests); False one after the other (probings).

    Raises:
        InputError: fewer than two parameters, an unknown path, an empty or infinite range, n not a power of two.
    """
    from SALib.analyze import sobol as analysis  # it brings pandas along, a third of a second for all pages
    from SALib.sample import sobol as sampling

    paths = tuple(ranges)
    declared = predictor.model.parameters
    for path, (low, high) in ranges.items():
        if path not in declared:
            raise unknown("parameter", path, declared)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"range of {path}: {low} to {high}; it must be finite, the lower end first")
    if len(paths) < 2:
        raise InputError("Sobol indices compare parameters: give ranges for two or more")
    if n < 2 or n & (n - 1):
        raise InputError(f"n = {n}: it must be a power of two, such as 256")
    problem = {"num_vars": len(paths), "names": list(paths), "bounds": [list(ranges[p]) for p in paths]}
    draws = sampling.sample(problem, n, calc_second_order=False, seed=seed)
    keys, outputs = _predicted(predictor, dict(values), paths, draws, batched)
    finite = np.isfinite(outputs).all(axis=(1, 2))
    if not finite.any():
        raise InputError("no prediction is finite over these ranges: narrow them to the energy's valid range")
    outputs[~finite] = outputs[finite].mean(0)
    first, total = {}, {}
    for k, key in enumerate(keys):
        variance = outputs[:, k].var(0)
        weight = variance / (variance.sum() or 1.0)
        found = [
            analysis.analyze(problem, y, calc_second_order=False, num_resamples=2, seed=seed)
            for y in outputs[:, k].T[variance > 0]
        ]
        used = weight[variance > 0]
        first[key] = (
            np.sum([w * f["S1"] for w, f in zip(used, found, strict=True)], axis=0) if found else np.zeros(len(paths))
        )
        total[key] = (
            np.sum([w * f["ST"] for w, f in zip(used, found, strict=True)], axis=0) if found else np.zeros(len(paths))
        )
    return Sobol(paths, dict(ranges), first, total, len(draws), float(1 - finite.mean()))


def _predicted(predictor, values, paths, draws, batched) -> tuple[list[str], Float[np.ndarray, "m k t"]]:
    """Every scalar channel at a few times, for every draw."""
    shapes = predictor.predict(values)
    places = []
    for r, recording in shapes.items():
        for c, channel in recording.channels.items():
            flat = np.asarray(channel.values).reshape(len(channel.values), -1)
            at = np.unique(np.linspace(0, len(flat) - 1, SHOWN_TIMES).round().astype(int))
            labels = [f"{r}/{c}"] if flat.shape[1] == 1 else [f"{r}/{c}[{i}]" for i in range(flat.shape[1])]
            places += [(label, r, c, i, np.resize(at, SHOWN_TIMES)) for i, label in enumerate(labels)]

    def one(x):
        predicted = predictor.predict(values | {path: x[i] for i, path in enumerate(paths)})
        rows = []
        for _, r, c, i, at in places:
            y = jnp.asarray(predicted[r].channels[c].values)
            rows.append(y.reshape(len(y), -1)[at, i])
        return jnp.stack(rows)

    if not batched:
        return [p[0] for p in places], np.stack([np.asarray(one(x)) for x in draws])
    many = jax.jit(jax.vmap(one))
    extra = -len(draws) % BATCH
    padded = np.concatenate([draws, draws[:1].repeat(extra, 0)])
    outputs = [np.asarray(many(jnp.asarray(padded[i : i + BATCH]))) for i in range(0, len(padded), BATCH)]
    return [p[0] for p in places], np.concatenate(outputs)[: len(draws)]

"""Toughness and friction of cuts by the balance of energies: in milliseconds, without strength."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tissuejax.effects.catalogue import effect
from tissuejax.estimation.covariance import uncertainty
from tissuejax.estimation.ending import Ending
from tissuejax.experiments.cutting_layers import layer
from tissuejax.experiments.cutting_predictor import CuttingPredictor
from tissuejax.experiments.cutting_record import FORCE, drawn, path_of, steady
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.cut_result import ENERGY, FRICTION, ONSET, STRENGTH, CutFit, misfit_said
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Sample

FEWEST = 10  # samples that a record keeps, or all of it is used


def by_balance(
    sample: Sample, model: Model, known: Mapping[str, float], names: tuple[str, ...], start: Mapping[str, float]
) -> CutFit:
    """Toughness, friction and the length over which the force sets in; see `fitting.cut.fit_cut`."""
    with_onset = model.with_effects(effect("onset"))
    free = [p for p in (ENERGY, FRICTION, ONSET) if p not in known]
    values = with_onset.defaults | dict(known) | {k: v for k, v in start.items() if k in with_onset.parameters}
    p = predictor(with_onset, calm(sample, names), names)
    if ENERGY not in known:  # the mean of what cuts fresh tissue, over the depth
        guess = []
        for n in names:
            path, seen = p.paths_of[n], p.sample.recordings[n].channels[FORCE]
            fresh = np.interp(seen.time, path.time, path.fresh * (path.depth > 0)) > 0.5
            deep = np.interp(seen.time, path.time, path.depth)[fresh]
            guess.append(np.median(np.asarray(seen.values)[fresh] / np.maximum(deep, 1e-6)))
        values[ENERGY] = max(0.05, 0.7 * float(np.mean(guess)))
    values[FRICTION] = known.get(FRICTION, 0.05)
    posed = problem(p, unknowns=Unknowns(free=tuple(free), start=values))
    ended = descend(posed, values, max_steps=60)
    found = posed.values(ended.y)
    r, J = posed.linearised(found)
    declared = p.model.parameters
    scale = np.array([declared[q].typical for q in free])
    widening = max(1.0, float(np.sqrt(r @ r / max(1, len(r) - len(free)))))
    spread = uncertainty(J, ended.y, scale, tuple(free), tuple(declared[q].unit for q in free), widening)
    std = dict(zip(free, spread.std.tolist(), strict=True))
    why = {STRENGTH: "the balance of energies holds no strength; fit by simulation"}
    if ONSET in free and found[ONSET] > 0.98 * p.model.declared[ONSET].upper:
        why[ENERGY] = "the force is still setting in where the record ends: a longer cut, or a simulation, tells it"
    status, chi2 = Ending.CONVERGED if ended.converged else ended.reason, float(r @ r / len(r))
    said = misfit_said(chi2, posed)
    none = dict.fromkeys(free, 0.0)
    p = predictor(with_onset, sample, names)  # all of the records, also where they did not count
    return CutFit(found, std, none, why, chi2, status, ended.runs, "balance", p, p.predict(found), 0.0, said)


def calm(sample: Sample, names: tuple[str, ...]) -> Sample:
    """The sample without the samples of which a balance of energies says nothing (`cutting_record.steady`)."""
    sample = drawn(sample)
    recordings = dict(sample.recordings)
    for name in names:
        r = recordings[name]
        seen = r.channels[FORCE]
        kept = steady(path_of(r, sample.geometry), np.asarray(seen.time, float))
        if kept.sum() > FEWEST:
            force = Channel(np.asarray(seen.time)[kept], np.asarray(seen.values)[kept], "N", seen.noise_std)
            recordings[name] = replace(r, channels={FORCE: force})
    return replace(sample, recordings=recordings)


def linear(p: CuttingPredictor, values: Mapping[str, float], known: Mapping[str, float]) -> dict[str, float]:
    """Toughness and friction to begin a simulation with, where the blade is in by more than its bevel.

    F / depth = (G + wedging) k + friction on the flats is linear in G k and the friction, k that of the bevels. An
    onset that is fitted along can take up all of a short record.
    """
    rows, right = [], []
    for name, path in p.paths_of.items():
        seen = p.sample.recordings[name].channels[FORCE]
        wedge, pressure = (float(q) for q in layer(p.model.across(()), values, path.half, path.thickness)[:2])
        bevel = 0.5 * path.thickness / np.tan(path.angle / 2)
        used = (path.x > bevel) & (path.x < path.length - bevel) & (path.depth > 0) & (np.abs(path.speed) > 1e-6)
        time = np.asarray(seen.time, float)
        kept = np.interp(time, path.time, used) > 0.99
        force, depth, x, fresh, speed = (
            np.interp(time, path.time, q)[kept] if q is not None else np.asarray(seen.values, float)[kept]
            for q in (None, path.depth, path.x, path.fresh, path.speed)
        )
        rows.append(np.stack([fresh, 2 * pressure * x * np.sign(speed)], 1))
        right.append(force / depth - wedge)
    A, b = np.concatenate(rows), np.concatenate(right)
    out = {}
    if FRICTION in known:
        A, b = A[:, :1], b - A[:, 1] * known[FRICTION]
    if len(b) > 5:
        found = np.linalg.lstsq(A, b, rcond=None)[0]
        least = 0.02 * float(np.max(np.abs(b)))  # a start is positive, whatever a short record says
        rub = known.get(FRICTION, max(float(found[-1]), 0.01))
        slopes = [np.tan(0.5 * path.angle) for path in p.paths_of.values()]
        bevel = float(np.mean([(1 + rub / t) / (1 - rub * t) for t in slopes]))
        out = {ENERGY: max(float(found[0]) / bevel, least), FRICTION: rub}
    return {k: v for k, v in out.items() if k not in known}

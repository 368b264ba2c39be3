"""Toughness, friction and strength from a whole cutting record, by gradients through a simulation.

First the balance of energies gives toughness and friction in milliseconds, then a slice with cohesive faces is fitted
from there: strength from the entry, toughness from the mean, friction from what grows with the length cut, the return
stroke or a second pass. The ripple of the mesh (one element's period) is no part of the record: both are compared
after a Gaussian of that width. The step between two meshes is added to the standard errors.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.effects.catalogue import effect
from tissuejax.errors import InputError
from tissuejax.experiments.cutting import layer
from tissuejax.experiments.cutting_predictor import CuttingPredictor
from tissuejax.experiments.cutting_record import FORCE, drawn
from tissuejax.experiments.cutting_run import CuttingSettings, element_size
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.setup import problem
from tissuejax.fitting.uncertainty import uncertainty
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

STRENGTH, ENERGY, FRICTION = "cohesion.strength", "cohesion.energy", "effects.blade-friction.coefficient"
ONSET = "effects.onset.longer"
OPEN = np.log(2) / 2 / 1.96  # relative standard error from which an interval spans a factor of two
COARSER = 1.5


@dataclass(frozen=True)
class CutFit:
    """What was found: values, standard errors and 95 % intervals by path, what is not identified and why, the record
    and its prediction, and how it went."""

    values: dict[str, float]
    std: dict[str, float]
    numerical: dict[str, float]
    unidentified: dict[str, str]
    chi2_per_sample: float
    status: str
    runs: int
    by: str
    predictor: CuttingPredictor
    predicted: dict[str, Recording]
    balance_error: float

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """95 % intervals, in logarithm."""
        spread = {p: np.exp(1.96 * self.std[p] / max(abs(self.values[p]), 1e-12)) for p in self.std}
        return {p: (self.values[p] / s, self.values[p] * s) for p, s in spread.items()}

    def record(self) -> dict:
        """Plain data."""
        kept = (
            "values",
            "std",
            "numerical",
            "unidentified",
            "chi2_per_sample",
            "status",
            "runs",
            "by",
            "balance_error",
        )
        return {k: getattr(self, k) for k in kept} | {"interval": self.interval}


def smoothed(sample: Sample, widths: Mapping[str, float]) -> Sample:
    """The sample with each cutting force smoothed along the path by a Gaussian of `widths` (s, standard deviation)."""
    from scipy.ndimage import gaussian_filter1d

    sample, out = drawn(sample), {}
    for name, r in sample.recordings.items():
        if name in widths:
            seen = r.channels[FORCE]
            spacing = float(np.median(np.diff(seen.time)))
            sigma = widths[name] / spacing
            quiet = 1 / math.sqrt(max(1.0, 2 * math.sqrt(math.pi) * sigma))
            values = (
                gaussian_filter1d(np.asarray(seen.values, float), sigma, mode="nearest") if sigma > 0.3 else seen.values
            )
            every = max(1, int(2 * sigma))  # samples that are still independent
            noise = None if seen.noise_std is None else seen.noise_std * (quiet if sigma > 0.3 else 1.0)
            made = Channel(np.asarray(seen.time)[::every], np.asarray(values)[::every], "N", noise)
            r = Recording(name, r.experiment, r.inputs, {FORCE: made}, r.attributes)
        out[name] = r
    return Sample(sample.name, out, sample.geometry, sample.density, sample.gravity, sample.source, sample.notes)


def fit_cut(
    sample: Sample,
    model: Model,
    known: Mapping[str, float],
    start: Mapping[str, float] | None = None,
    names: tuple[str, ...] = (),
    by: str = "simulation",
    settings: CuttingSettings | None = None,
    max_steps: int = 12,
    numerical: bool = True,
) -> CutFit:
    """Fit the cuts of a sample.

    Args:
        model: energy, volumetric energy, cohesive law; `blade-friction` is added if it is not there.
        known: what other tests told of the tissue: `energy.*`, `volumetric.*`, and whatever is to stay fixed.
        start: where to begin (strength; toughness and friction come from the balance).
        names: recordings; all cuts by default.
        by: "simulation", or "balance" (no strength). numerical: add the step between two meshes to the errors.

    Raises:
        InputError: no cuts, or nothing known of the tissue: toughness and wedging have one sum in one pass.
    """
    names = names or tuple(n for n, r in sample.recordings.items() if r.experiment == "cutting")
    if not names:
        raise InputError(f"{sample.name} has no cutting recording; `tissuejax inspect` says what it has")
    bare = [p for p in model.declared if p.split(".")[0] in ("energy", "volumetric") and p not in known]
    if bare:
        raise InputError(
            f"{', '.join(bare)}: one record holds toughness and wedging in one sum. Give what a probing or a "
            "material test "
            f'found, e.g. --fix "{bare[0]}=1500"'
        )
    if not any(e.name == "blade-friction" for e in model.effects):
        model = model.with_effects(effect("blade-friction"))
    first = _by_balance(sample, model, known, names, dict(start or {}))
    values = first.values
    if by == "balance":
        return first
    values = values | _linear(first.predictor, values, known) | dict(start or {})
    if STRENGTH not in (start or {}) and STRENGTH not in known:  # a face that parts at half the blade's thickness
        thickness = min(p.thickness for p in first.predictor.paths_of.values())
        values[STRENGTH] = 4 * values[ENERGY] / thickness
    settings = settings or CuttingSettings()
    sizes = {n: element_size(settings, p) for n, p in first.predictor.paths_of.items()}
    speed = {n: float(np.median(np.abs(p.speed[p.fresh > 0.5]))) for n, p in first.predictor.paths_of.items()}
    seen = smoothed(sample, {n: 0.5 * sizes[n] / speed[n] for n in names})
    plain = replace(model, effects=tuple(e for e in model.effects if e.name != "onset"))
    values = {k: v for k, v in values.items() if not k.startswith("effects.onset")}
    free = tuple(p for p in (STRENGTH, ENERGY, FRICTION) if p not in known)
    top = settings.strongest * values[STRENGTH]
    posed = problem(
        predictor(plain, seen, names, by="simulation", settings=settings, start=values, lenient=True),
        free=free, start=values,
        bounds={STRENGTH: (0.1 * values[STRENGTH], top), ENERGY: (0.05 * values[ENERGY], 20 * values[ENERGY])},
    )  # fmt: skip
    ended = descend(posed, values, max_steps=max_steps, tolerance=1e-4)
    found = posed.values(ended.y)
    r, J = posed.linearised(found)
    declared = posed.predictor.model.parameters
    widening = max(1.0, float(np.sqrt(r @ r / max(1, len(r) - len(free)))))
    scale = np.array([declared[p].typical for p in free])
    spread = uncertainty(J, ended.y, scale, free, tuple(declared[p].unit for p in free), widening)
    shift = dict.fromkeys(free, 0.0)
    if numerical:
        coarse = replace(settings, h=max(sizes.values()) * COARSER)
        other = replace(
            posed, predictor=predictor(plain, seen, names, by="simulation", settings=coarse, start=values, lenient=True)
        )
        step = np.linalg.lstsq(J, r - other.residuals(found), rcond=None)[0]
        shift = dict(zip(free, np.abs(step).tolist(), strict=True))
    std = {p: float(np.hypot(s, shift[p])) for p, s in zip(free, spread.std, strict=True)}
    made = posed.predictor.predict(found)
    why = _unidentified(posed.predictor, found, std, free, dict(zip(free, posed.box.at_bound(ended.y), strict=True)))
    status = "converged" if ended.converged else ended.reason
    worst = _imbalance(posed.predictor, found)
    chi2 = float(r @ r / len(r))
    return CutFit(found, std, shift, why, chi2, status, ended.n_evaluations, by, posed.predictor, made, worst)


def _by_balance(sample, model, known, names, start):
    with_onset = model.with_effects(effect("onset"))
    free = [p for p in (ENERGY, FRICTION, ONSET) if p not in known]
    values = with_onset.defaults | dict(known) | {k: v for k, v in start.items() if k in with_onset.parameters}
    p = predictor(with_onset, sample, names)
    if ENERGY not in known:  # the mean of what cuts fresh tissue, over the depth
        guess = []
        for n in names:
            path, seen = p.paths_of[n], p.sample.recordings[n].channels[FORCE]
            fresh = np.interp(seen.time, path.time, path.fresh * (path.depth > 0)) > 0.5
            deep = np.interp(seen.time, path.time, path.depth)[fresh]
            guess.append(np.median(np.asarray(seen.values)[fresh] / np.maximum(deep, 1e-6)))
        values[ENERGY] = max(0.05, 0.7 * float(np.mean(guess)))
    values[FRICTION] = known.get(FRICTION, 0.05)
    posed = problem(p, free=tuple(free), start=values)
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
    status, chi2 = "converged" if ended.converged else ended.reason, float(r @ r / len(r))
    none = dict.fromkeys(free, 0.0)
    return CutFit(found, std, none, why, chi2, status, ended.n_evaluations, "balance", p, p.predict(found), 0.0)


def _linear(p: CuttingPredictor, values, known) -> dict[str, float]:
    """Toughness and friction to begin a simulation with, where the blade is in by more than its bevel.

    F / depth = (G + wedging) k + friction on the flats is linear in G k and the friction, k that of the bevels. An
    onset that is fitted along can take up all of a short record.
    """
    rows, right = [], []
    for name, path in p.paths_of.items():
        seen = p.sample.recordings[name].channels[FORCE]
        wedge, pressure = (float(q) for q in layer(p.model.across(()), values, path.half, path.thickness))
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


def _unidentified(p, values, std, free, at_bound) -> dict[str, str]:
    """What the record can't tell, in words."""
    why = {}
    entered = any(path.x[0] <= 0 and path.notch <= 0 for path in p.paths_of.values())
    if STRENGTH in free:
        if not entered:
            why[STRENGTH] = "no record has an entry into fresh tissue, and a steady cut holds no strength"
        elif not std[STRENGTH] < OPEN * values[STRENGTH]:
            why[STRENGTH] = "its 95 % interval spans more than a factor of two"
        elif at_bound.get(STRENGTH):
            why[STRENGTH] = (
                f"it ran to the {at_bound[STRENGTH]} end of what this mesh allows: refine, or see `cut resolve`"
            )
    if FRICTION in free and not std[FRICTION] < 0.5 * abs(values[FRICTION]):
        why[FRICTION] = f"not told from zero (standard error {std[FRICTION]:.2g}): add a return stroke or a second pass"
    if ENERGY in free and not std[ENERGY] < OPEN * values[ENERGY]:
        why[ENERGY] = "its 95 % interval spans more than a factor of two"
    return why


def _imbalance(p: CuttingPredictor, values) -> float:
    """Worst share of the blade's work that is not accounted for, over the recordings."""
    return max(float(ran.imbalance) for ran in p.run(values).values())


def along(found: CutFit, knots: int = 18, roughness: float = 0.05) -> Float[np.ndarray, "k 2"]:
    """Toughness along the path, one value a knot: place (m) and J/m^2, by the reverse mode of the balance of energies.

    The misfit over the noise plus the squared steps from knot to knot over `roughness` (of the toughness) is made
    least.
    """
    from scipy.optimize import minimize

    name = found.predictor.names[0]
    field = replace(
        found.predictor.model, effects=(*found.predictor.model.effects, effect("toughness-map", knots=knots))
    )
    if not any(e.name == "onset" for e in field.effects):
        field = field.with_effects(effect("onset"))
    p = predictor(replace(field, recordings=()), found.predictor.sample, (name,))
    seen = p.sample.recordings[name].channels[FORCE]
    values = p.model.defaults | {k: v for k, v in found.values.items() if k in p.model.parameters}
    order = list(p.model.across(()).declared)
    at = [order.index(f"effects.toughness-map.m{k + 1}") for k in range(knots)]
    base = jnp.array([float(values[q]) for q in order])
    measured, sigma = jnp.asarray(seen.values), seen.noise_std or 0.02 * float(np.max(np.abs(seen.values)))

    @jax.jit
    def misfit(m):
        force, _ = p.force(name, base.at[jnp.array(at)].set(m))
        return jnp.sum(((force - measured) / sigma) ** 2) + jnp.sum((jnp.diff(m) / roughness) ** 2)

    slope = jax.jit(jax.value_and_grad(misfit))
    start = np.zeros(knots)
    best = minimize(lambda m: tuple(np.asarray(x, float) for x in slope(m)), start, jac=True, method="L-BFGS-B",
                    bounds=[(-0.95, 10.0)] * knots)  # fmt: skip
    length = p.paths_of[name].length
    return np.stack([np.linspace(0, length, knots), values[ENERGY] * (1 + best.x)], 1)

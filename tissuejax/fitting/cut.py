"""Toughness, friction and strength from a whole cutting record, by gradients through a simulation.

First the balance of energies gives toughness and friction in milliseconds, then a slice with cohesive faces is fitted
from there: strength from the entry, toughness from the mean, friction from what grows with the length cut, the return
stroke or a second pass. The ripple of the mesh (one element's period) is no part of the record: means over one element
of the way are compared, in which it is not. Stiffness and penalty of the slice depend on the values that it is made
for, so it is made anew where the descent has come to, until they agree. The step between two meshes is added to the
standard errors.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.effects.catalogue import effect
from tissuejax.errors import InputError, UnstableSimulation
from tissuejax.estimation.covariance import uncertainty
from tissuejax.estimation.descent import Ended
from tissuejax.estimation.problem import Problem
from tissuejax.experiments.cutting_blocks import Blocks, blocks
from tissuejax.experiments.cutting_record import FORCE, Path, drawn
from tissuejax.experiments.cutting_run import CuttingSettings, element_size
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.cut_balance import by_balance, linear
from tissuejax.fitting.cut_meshes import COARSER, FINER, on_one_mesh, on_two_meshes
from tissuejax.fitting.cut_resolution import plane_modulus, refuse_joules
from tissuejax.fitting.cut_result import ENERGY, FRICTION, OPEN, STRENGTH, CutFit, described, misfit_said
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.model import Model
from tissuejax.parameters import checked, under
from tissuejax.recordings.recording import Channel, Recording, Sample

SLICES = 12
SETTLED, FAR = 1e-3, 1e-2  # relative decrease of the misfit at which a descent ends: the last, the others
SAME = 1.3  # a slice made for a strength serves up to this ratio
# How far strength and energy may go from where a slice was made, in its first round and in later ones: toughness and
# friction first, which mean and slope of the force tell from anywhere, and strength about them. All at once from half
# the values, a descent went to a brittle tissue (strength at its bound, a twentieth of the toughness) and stayed there
FIRST_STARTS, LATER = {STRENGTH: 1.25, ENERGY: 3.0}, {STRENGTH: 2.0, ENERGY: 2.0}


def blocked(sample: Sample, paths: Mapping[str, Path], sizes: Mapping[str, float]) -> tuple[Sample, dict[str, Blocks]]:
    """The sample with the means of each cutting force over blocks of `sizes` (m) of the way, and the blocks."""
    sample, out, made = drawn(sample), {}, {}
    for name, r in sample.recordings.items():
        if name in sizes:
            seen = r.channels[FORCE]
            made[name] = b = blocks(paths[name], np.asarray(seen.time), sizes[name])
            time, force = (np.asarray(b.mean(jnp.asarray(x, float))) for x in (b.time, seen.values))
            noise = None if seen.noise_std is None else seen.noise_std / math.sqrt(b.samples)
            r = Recording(name, r.experiment, r.inputs, {FORCE: Channel(time, force, "N", noise)}, r.attributes)
        out[name] = r
    sample = Sample(sample.name, out, sample.geometry, sample.density, sample.gravity, sample.source, sample.notes)
    return sample, made


def fit_cut(
    sample: Sample,
    model: Model,
    known: Mapping[str, float],
    start: Mapping[str, float] | None = None,
    names: tuple[str, ...] = (),
    by: str = "simulation",
    settings: CuttingSettings | None = None,
    max_steps: int = 4,
    numerical: bool = True,
) -> CutFit:
    """Fit the cuts of a sample.

    Args:
        model: energy, volumetric energy, cohesive law; `blade-friction` is added if it is not there.
        known: what other tests say of the tissue: `energy.*`, `volumetric.*`, and whatever is to stay fixed.
        start: where to begin; what the balance tells of toughness and friction is tried beside it, and with either a
            strength by which faces part at half the blade's thickness. The descent begins with the best of them,
            and goes on to the next where it ends in no description of the record.
        names: recordings; all cuts by default.
        by: "simulation", or "balance" (no strength). numerical: go on on a finer mesh, and add the step between the
            two to the errors.

    Raises:
        InputError: no cuts, values out of their range (an energy in J), or nothing known of the tissue: toughness
            and wedging have one sum in one pass.
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
    for given in (known, start or {}):
        checked(given, model.across(names).parameters)
        refuse_joules(given.get(ENERGY, np.inf))
    first = by_balance(sample, model, known, names, dict(start or {}))
    if by == "balance":
        return first
    balanced = linear(first.predictor, first.values, known)
    values = first.values | balanced | dict(start or {})
    thickness = min(p.thickness for p in first.predictor.paths_of.values())

    def parting(v):  # at half the blade's thickness; faces that hold beyond it press on the flats
        return v if STRENGTH in known else v | {STRENGTH: 4 * v[ENERGY] / thickness}

    values = parting(values) | {k: v for k, v in (start or {}).items() if k == STRENGTH}
    settings = settings or CuttingSettings()
    sizes = {n: element_size(settings, p) for n, p in first.predictor.paths_of.items()}
    seen, means = blocked(sample, first.predictor.paths_of, sizes)
    plain = replace(model, effects=tuple(e for e in model.effects if e.name != "onset"))
    values = {k: v for k, v in values.items() if not k.startswith("effects.onset")}
    free = tuple(p for p in (STRENGTH, ENERGY, FRICTION) if p not in known)
    options = {"by": "simulation", "lenient": True, "blocks": means}
    made = predictor(plain, seen, names, settings=settings, start=values, **options)
    tried = (values, values | balanced, parting(values), parting(values | balanced))
    starts = sorted({tuple(v.values()): v for v in tried}.values(), key=partial(_misfit, made, free))
    best, runs = None, 0
    for values in starts:  # the next only where the better one to begin with led to no description of the record
        posed, ended, settled, spent = _rounds(made.prepared(values), free, values, max_steps)
        runs += spent
        if best is None or ended.cost < best[1].cost:
            best = posed, ended, settled
        if described(2 * best[1].cost / posed.n_samples, posed):
            break
    posed, ended, settled = best
    values, declared = posed.values(ended.y), posed.predictor.model.parameters
    if not np.isfinite(ended.cost):
        raise UnstableSimulation(
            f"no simulated cut of strength {values[STRENGTH]:.3g} Pa or more ran through: an element inverts at the "
            "entry. Take larger elements (--h), start from a lower strength (--start cohesion.strength=...), or leave "
            "the simulation (--by balance)"
        )
    if numerical:
        others = (replace(settings, h=k * max(sizes.values())) for k in (FINER, COARSER))
        meshes = (predictor(plain, seen, names, settings=other, start=values, **options) for other in others)
        found = on_two_meshes(posed, values, *meshes)
    else:
        found = on_one_mesh(posed, values)
    values, r, at, shift = found.values, found.residuals, found.predictor, found.shift
    _, J = posed.linearised(values)
    widening = max(1.0, float(np.sqrt(r @ r / max(1, len(r) - len(free)))))
    scale = np.array([declared[p].typical for p in free])
    spread = uncertainty(J, posed.vector(values), scale, free, tuple(declared[p].unit for p in free), widening)
    std = {p: float(np.hypot(s, shift[p])) for p, s in zip(free, spread.std, strict=True)}
    at_bound = dict(zip(free, posed.box.at_bound(ended.y), strict=True))
    why = _unidentified(at, values, std, free, at_bound)
    if not np.isfinite(list(shift.values())).all():
        why |= dict.fromkeys(free, "elements of no other size ran through, so what the mesh does to it is not known")
    status = "converged" if settled else ended.reason if not ended.converged else "slice and estimate do not settle"
    worst = max(float(x.imbalance) for x in found.ran.values())
    chi2 = float(r @ r / len(r))
    said = (*misfit_said(chi2, posed), *_unresolved(plain, values, thickness, max(sizes.values()), free, why))
    if numerical and not found.finer:
        said += ("elements of half the size did not run through, so these are the values of the fit's own elements",)
    return CutFit(values, std, shift, why, chi2, status, runs, by, at, found.predicted, worst, said)


def _rounds(made, free, values, max_steps) -> tuple[Problem, Ended, bool, int]:
    """Descents from one start, the slice made anew between them: the last, whether they settled, runs.

    Settled is what a slice made for it leaves in place, by a descent that converges or finds less than `FAR` to gain
    (facets that come over an edge put kinks into the misfit, on which a descent may shrink its steps for ever; a slice
    made anew gets it off them, so few evaluations are spent on each).
    """
    runs = 0
    for n in range(SLICES):
        posed = _posed(made, free, values, LATER if n else FIRST_STARTS)
        ended = descend(posed, values, max_steps=max_steps, tolerance=SETTLED if n else FAR)
        runs += ended.runs
        if not np.isfinite(ended.cost):  # the entry folds: weaker tissue does not
            values = values | {STRENGTH: values[STRENGTH] / 2}
        else:
            before, values = values, posed.values(ended.y)
            near = max(abs(np.log(values[p] / before[p])) for p in LATER) < np.log(SAME)
            if n and near and (ended.converged or ended.cost > (1 - FAR) * ended.trace[0][0]):
                return posed, ended, True, runs
        made = made.prepared(values)
    return posed, ended, False, runs


def _misfit(made, free, values) -> float:
    """Sum of squares at a start; infinite where the run breaks down."""
    r, _ = _posed(made.prepared(values), free, values, {}).linearised(values)
    return float(r @ r) if np.isfinite(r).all() else np.inf


def _posed(made, free, values, reach):
    bounds = {p: (values[p] / k, values[p] * k) for p, k in reach.items() if p in free}
    return problem(made, unknowns=Unknowns(free=free, start=values, bounds=bounds))


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


def _unresolved(model: Model, values, thickness: float, h: float, free, why: dict[str, str]) -> tuple[str, ...]:
    """A warning where faces hold on beside the blade; into `why` a fitted strength that elements of size h do not
    resolve."""
    mu = float(model.energy.initial_shear_modulus(under("energy", values)))
    bulk = float(model.volumetric.bulk_modulus(under("volumetric", values)))
    cohesive = plane_modulus(mu, bulk) * values[ENERGY] / values[STRENGTH] ** 2
    if STRENGTH in free and cohesive < h:
        why[STRENGTH] = (
            f"elements of {1e3 * h:.3g} mm do not resolve it (cohesive length {1e3 * cohesive:.3g} mm), so it is a "
            "number of the mesh: `tissuejax cut resolve` says which would"
        )
    apart = 2 * values[ENERGY] / values[STRENGTH]
    if apart <= thickness:
        return ()
    return (
        f"the blade is thinner ({1e3 * thickness:.3g} mm) than the separation ({1e3 * apart:.3g} mm): the tissue holds "
        "on beside its flats, so toughness and strength are not told apart well",
    )


def along(found: CutFit, knots: int = 18, roughness: float = 0.05) -> Float[np.ndarray, "k 2"]:
    """Toughness along the path, by the reverse mode of the balance of energies: place (m) and J/m^2 of each knot that
    the cut came to.

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
    path = p.paths_of[name]
    at = np.linspace(0, path.length, knots)
    cut = at <= path.front.max()  # beyond, nothing was cut
    return np.stack([at, values[ENERGY] * (1 + best.x)], 1)[cut]

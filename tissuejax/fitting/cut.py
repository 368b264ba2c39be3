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
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.effects.catalogue import effect
from tissuejax.errors import InputError
from tissuejax.estimation.covariance import uncertainty
from tissuejax.experiments.cutting_blocks import Blocks, blocks
from tissuejax.experiments.cutting_record import FORCE, drawn
from tissuejax.experiments.cutting_record import Path as Way
from tissuejax.experiments.cutting_run import CuttingSettings, element_size
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.checkpoint import Checkpoint, mark_of
from tissuejax.fitting.cut_balance import by_balance, linear
from tissuejax.fitting.cut_meshes import COARSER, FINER, on_one_mesh, on_two_meshes
from tissuejax.fitting.cut_resolution import plane_modulus, refuse_joules
from tissuejax.fitting.cut_result import ENERGY, FRICTION, OPEN, STRENGTH, CutFit, misfit_said
from tissuejax.fitting.cut_search import Search, posed_at
from tissuejax.model import Model
from tissuejax.parameters import checked, under
from tissuejax.progress import Progress, Silent
from tissuejax.recordings.recording import Channel, Recording, Sample


def blocked(sample: Sample, paths: Mapping[str, Way], sizes: Mapping[str, float]) -> tuple[Sample, dict[str, Blocks]]:
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
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> CutFit:
    """Fit the cuts of a sample.

    Args:
        model: energy, volumetric energy, cohesive law; `blade-friction` is added if it is not there.
        known: what other tests say of the tissue: `energy.*`, `volumetric.*`, and whatever is to stay fixed.
        start: where to begin; what the balance tells of toughness and friction is tried beside it, and with either a
            strength by which faces part at half the blade's thickness. The descent begins with the best of them,
            and goes on to the next where it ends in no description of the record.
        names: recordings; all cuts by default.
        by: "simulation"; "balance" (no strength); "either": a simulation unless its elements resolve no strength by
            which this blade would part the tissue, so that it could tell none.
        numerical: go on on a finer mesh, and add the step between the two to the errors.
        checkpoint: a file that keeps the last accepted values; the same fit goes on from there.
        progress: advanced after every run.

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
    values = first.values | linear(first.predictor, first.values, known)
    paths = first.predictor.paths_of
    settings = settings or CuttingSettings()
    sizes = {n: element_size(settings, p) for n, p in paths.items()}
    thickness = min(p.thickness for p in paths.values())
    coarse = too_coarse(model, values, thickness, max(sizes.values()))
    if by == "either" and coarse:
        return replace(first, unidentified=first.unidentified | {STRENGTH: coarse})
    seen, means = blocked(sample, paths, sizes)
    plain = replace(model, effects=tuple(e for e in model.effects if e.name != "onset"))
    free = tuple(p for p in (STRENGTH, ENERGY, FRICTION) if p not in known)
    options = {"by": "simulation", "lenient": True, "blocks": means}
    starts = _starts(values, dict(start or {}), known, thickness)
    made = predictor(plain, seen, names, settings=settings, start=starts[0], **options)
    with (progress or Silent()).stage(f"cutting {', '.join(names)}", None) as stage:
        asked = settings, made.paths_of, max_steps, sample.density, dict(start or {})
        mark = mark_of(posed_at(made, free, starts[0], {}), *asked)
        search = Search(free, max_steps, Checkpoint(checkpoint, mark, starts[0]), stage)
        best = search.best(made, starts)
        posed = best.posed
        values, declared = posed.values(best.ended.y), posed.predictor.model.parameters
        if numerical:
            stage.advance(note="elements of half the size")
            others = (replace(settings, h=k * max(sizes.values())) for k in (FINER, COARSER))
            meshes = (predictor(plain, seen, names, settings=other, start=values, **options) for other in others)
            found = on_two_meshes(posed, values, *meshes)
        else:
            found = on_one_mesh(posed, values)
        values, r, at, shift = found.values, found.residuals, found.predictor, found.shift
        stage.advance(note="standard errors")
        _, J = posed.linearised(values)
        search.kept.done()
    widening = max(1.0, float(np.sqrt(r @ r / max(1, len(r) - len(free)))))
    scale = np.array([declared[p].typical for p in free])
    spread = uncertainty(J, posed.vector(values), scale, free, tuple(declared[p].unit for p in free), widening)
    std = {p: float(np.hypot(s, shift[p])) for p, s in zip(free, spread.std, strict=True)}
    at_bound = dict(zip(free, posed.box.at_bound(best.ended.y), strict=True))
    why = _unidentified(at, values, std, free, at_bound)
    if not np.isfinite(list(shift.values())).all():
        why |= dict.fromkeys(free, "elements of no other size ran through, so what the mesh does to it is not known")
    worst = max(float(x.imbalance) for x in found.ran.values())
    chi2 = float(r @ r / len(r))
    said = (*misfit_said(chi2, posed), *_unresolved(plain, values, thickness, max(sizes.values()), free, why))
    if numerical and not found.finer:
        said += ("elements of half the size did not run through, so these are the values of the fit's own elements",)
    return CutFit(
        values, std, shift, why, chi2, best.status, search.runs, "simulation", at, found.predicted, worst, said
    )


def _starts(balanced, told, known, thickness) -> list[dict[str, float]]:
    """Where descents may begin: what was told over what the balance says, and the balance alone; either also with the
    strength by which faces part at half the blade's thickness (faces that hold beyond it press on the flats)."""

    def parting(v):
        return v if STRENGTH in known else v | {STRENGTH: 4 * v[ENERGY] / thickness}

    balanced = {k: v for k, v in balanced.items() if not k.startswith("effects.onset")}
    own = {k: balanced[k] for k in (ENERGY, FRICTION) if k not in known}
    first = parting(balanced | told) | {k: v for k, v in told.items() if k == STRENGTH}
    tried = (first, first | own, parting(first), parting(first | own))
    return list({tuple(v.values()): v for v in tried}.values())


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


def too_coarse(model: Model, values, thickness: float, h: float) -> str:
    """Why elements of size `h` tell no strength by which this blade parts the tissue, or nothing."""
    least = 2 * values[ENERGY] / thickness
    cohesive = _plane(model, values) * values[ENERGY] / least**2
    if cohesive >= h:
        return ""
    return (
        f"a blade of {1e3 * thickness:.3g} mm parts this tissue at {least:.3g} Pa or more, which elements of "
        f"{1e3 * h:.3g} mm do not resolve (cohesive length {1e3 * cohesive:.3g} mm): a simulation would tell none. "
        "`tissuejax cut resolve` says which elements would; --by simulation simulates all the same"
    )


def _plane(model: Model, values) -> float:
    mu = float(model.energy.initial_shear_modulus(under("energy", values)))
    return plane_modulus(mu, float(model.volumetric.bulk_modulus(under("volumetric", values))))


def _unresolved(model: Model, values, thickness: float, h: float, free, why: dict[str, str]) -> tuple[str, ...]:
    """A warning where faces hold on beside the blade; into `why` a fitted strength that elements of size h do not
    resolve."""
    cohesive = _plane(model, values) * values[ENERGY] / values[STRENGTH] ** 2
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

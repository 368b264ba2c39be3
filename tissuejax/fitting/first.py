"""Where a fit of probings begins, found through a surrogate: thousandths of a second a run in place of a simulation.

A surrogate is one energy, tabulated. What can be moved in it is a factor on all its moduli and what lies on top of the
tables: shares and times of relaxation, friction, adhesion. Those of them that are free are fitted to the recorded
forces; markers say nothing of them, since the shape under the ball is tabulated. The fit by simulations that follows
estimates every free parameter from there and takes nothing else from the surrogate.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import least_squares

from tissuejax.errors import InputError
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.transforms import Box, chained
from tissuejax.experiments.probing_sensors import read_at
from tissuejax.surrogate.precompute import Precomputed
from tissuejax.surrogate.predict import force_along, within_box
from tissuejax.surrogate.surrogate import Surrogate

FACTOR = "factor"
LEAVES = {
    "effects.friction.coefficient": "rub.friction",
    "effects.friction.give": "rub.give",
    "effects.adhesion.strength": "rub.strength",
    "effects.adhesion.reach": "rub.reach",
}
SERIES = {"effects.viscoelasticity.g": "memory.g", "effects.viscoelasticity.tau": "memory.tau"}
SAME_RADIUS = 0.01  # of the ball: the surrogate's and the recording's may differ by so much
MOST = 60  # evaluations


@dataclass(frozen=True)
class First:
    """What a surrogate made of the recordings.

    Attributes:
        start: where the fit by simulations begins, by dotted path, SI.
        factor: on the moduli that were tabulated.
        used: recordings within the surrogate's box; left_out: why not, by the name of the others.
        force_rms: of predicted less recorded force over all components, N, with the tabulated values and with those
            found ("before", "after").
        evaluations: of the surrogate, Jacobians included.
    """

    start: Mapping[str, float]
    factor: float
    used: tuple[str, ...]
    left_out: Mapping[str, str]
    force_rms: Mapping[str, float]
    evaluations: int

    def record(self) -> dict:
        """As a part of result.json."""
        return asdict(self)


def first(problem: Problem, made: Precomputed, given: Mapping[str, float]) -> First:
    """Fit a surrogate to the recorded forces of a problem.

    Args:
        problem: of probings.
        made: a surrogate of the same energy, with the ball of the recordings.
        given: values that the user named; they are not moved.

    Raises:
        InputError: another energy, another ball, no recording with a force within the box.
    """
    _same(problem, made)
    surrogate = _as_told(problem, made.surrogate, given)
    data, left_out = _data(problem, surrogate)
    tabulated = {p: float(v) for p, v in made.record["model"]["values"].items()}
    moduli = tuple(p for p in _moduli(problem) if p not in given)
    leaves = {p: leaf for p, leaf in _leaves(problem.free, surrogate).items() if p not in given}
    paths = ((FACTOR,) if moduli else ()) + tuple(leaves)
    if not paths:
        raise InputError("--first: no modulus is free, nor anything else that a surrogate can move")
    box, x0 = _box(problem, paths, tabulated)

    @eqx.filter_jit
    def misfit(surrogate: Surrogate, x: Float[Array, " p"]) -> Float[Array, " n"]:
        moved = _moved(surrogate, paths, leaves, x)
        return jnp.concatenate([_residual(moved, one) for one in data])

    slopes = eqx.filter_jit(jax.jacfwd(misfit, argnums=1))
    evaluations = 0

    def residuals(y):
        nonlocal evaluations
        evaluations += 1
        return np.asarray(misfit(surrogate, jnp.asarray(box.bounded(y)[0])))

    def jacobian(y):
        nonlocal evaluations
        evaluations += 1
        x, slope = box.bounded(y)
        return chained(np.asarray(slopes(surrogate, jnp.asarray(x))), slope)

    y0 = box.free(x0)
    found = least_squares(residuals, y0, jacobian, max_nfev=MOST, x_scale="jac")
    x = dict(zip(paths, map(float, box.bounded(found.x)[0]), strict=True))
    factor = x.pop(FACTOR, 1.0)
    start = _inside(problem, {p: factor * tabulated[p] for p in moduli} | x)
    for path in problem.free:  # what the moduli stand beside, such as an exponent, as it was tabulated
        if path.startswith(("energy.", "volumetric.")) and path not in {*moduli, *given}:
            start |= _inside(problem, {path: tabulated[path]})
    sigma = np.concatenate([np.full(one.rows, one.sigma) for one in data])
    rms = {
        when: float(np.sqrt(np.mean((sigma * r) ** 2)))
        for when, r in {"before": residuals(y0), "after": found.fun}.items()
    }
    return First(start, factor, tuple(one.name for one in data), left_out, rms, evaluations)


class _Data(eqx.Module):
    """Path and force of one recording."""

    name: str = eqx.field(static=True)
    rows: int = eqx.field(static=True)
    sigma: float = eqx.field(static=True)
    gives: bool = eqx.field(static=True)
    clock: Float[Array, " m"]
    path: Float[Array, "m 3"]
    time: Float[Array, " n"]
    force: Float[Array, "n 3"]
    seen: Float[Array, " r"]


def _residual(surrogate: Surrogate, one: _Data) -> Float[Array, " r"]:
    along = force_along if one.gives else Surrogate.respond  # which takes a third of the time to compile
    told = read_at(one.time, one.clock, along(surrogate, one.clock, one.path))
    return (told - one.force).ravel()[one.seen] / one.sigma


def _data(problem: Problem, surrogate: Surrogate) -> tuple[list[_Data], dict[str, str]]:
    found, left_out = [], {}
    for name, channel in problem.channels:
        if channel != "force":
            continue
        recording = problem.predictor.sample.recordings[name]
        radius = float(recording.attributes.get("probe/radius", np.nan))
        if "probe/edge" in recording.attributes or abs(radius / float(surrogate.radius) - 1) > SAME_RADIUS:
            raise InputError(
                f"--first: the surrogate is of a ball of {1e3 * float(surrogate.radius):.2f} mm, recording {name} of "
                + ("a flat punch" if "probe/edge" in recording.attributes else f"{1e3 * radius:.2f} mm")
            )
        try:
            clock, path = within_box(surrogate, recording)
        except InputError as fault:
            left_out[name] = str(fault)
            continue
        series, seen = recording.channels[channel], problem.seen[name, channel]
        force = jnp.asarray(np.nan_to_num(np.asarray(series.values, float)))
        time = jnp.asarray(np.asarray(series.time, float))
        sigma, gives = problem.sigma((name, channel)), float(surrogate.rig.compliance) != 0
        found.append(_Data(name, len(seen), sigma, gives, clock, path, time, force, seen))
    if not found:
        raise InputError(
            "--first: no recorded force lies within the surrogate's box: " + ("; ".join(left_out.values()) or "none")
        )
    return found, left_out


def _same(problem: Problem, made: Precomputed) -> None:
    from tissuejax.energies.catalogue import forms_of, name_of

    model, told = problem.predictor.model, made.record["model"]
    mine = name_of(model.energy), forms_of(model.energy, model.volumetric)
    if mine != (told["energy"], told["forms"]):
        raise InputError(
            f"--first: the surrogate was tabulated with {told['energy']} ({_forms(told['forms'])}), the fit is of "
            f"{mine[0]} ({_forms(mine[1])}): precompute one with the same energy"
        )
    sample, other = problem.predictor.sample.name, made.record.get("sample", "slab")
    if other not in ("slab", sample):
        raise InputError(f"--first: the surrogate is of sample {other}, the recordings are of {sample}")


def _forms(forms: Mapping[str, str]) -> str:
    return ", ".join(forms.values()) or "no forms"


def _moduli(problem: Problem) -> tuple[str, ...]:
    declared = problem.predictor.model.parameters
    rooms = ("energy.", "volumetric.")
    return tuple(p for p in problem.free if p.startswith(rooms) and declared[p].unit == "Pa")


def _as_told(problem: Problem, surrogate: Surrogate, given: Mapping[str, float]) -> Surrogate:
    """With what the fit holds fixed, or the user named, in place of what was tabulated; without effects that the fit
    does not have."""
    names = {effect.name for effect in problem.predictor.model.effects}
    neutral = {} if "friction" in names else {"rub.friction": 0.0}
    neutral |= {} if "adhesion" in names else {"rub.strength": 0.0}
    if surrogate.memory is not None and "viscoelasticity" not in names:
        neutral["memory.g"] = jnp.zeros(len(surrogate.memory.g))
    held = {p: float(v) for p, v in problem.start.items() if p in given or p not in problem.free}
    leaves = _leaves(held, surrogate)
    return _moved(surrogate.put(neutral), tuple(leaves), leaves, jnp.array([held[p] for p in leaves]))


def _leaves(paths: Iterable[str], surrogate: Surrogate) -> dict[str, tuple[str, int | None]]:
    """What of the surrogate a parameter is, and its place in a series."""
    found: dict[str, tuple[str, int | None]] = {}
    for path in paths:
        if path in LEAVES:
            found[path] = LEAVES[path], None
        for head, leaf in SERIES.items():
            number = path.removeprefix(head)
            known = 0 if surrogate.memory is None else len(surrogate.memory.g)
            if path != number and number.isdigit() and int(number) <= known:
                found[path] = leaf, int(number) - 1
    return found


def _moved(surrogate: Surrogate, paths, leaves, x: Float[Array, " p"]) -> Surrogate:
    changes: dict[str, Array] = {}
    for path, value in zip(paths, x):
        leaf, place = leaves.get(path, (FACTOR, None))
        if place is None:
            changes[leaf] = value
        else:
            room, name = leaf.split(".")
            now = changes.get(leaf, jnp.asarray(getattr(getattr(surrogate, room), name)))
            changes[leaf] = now.at[place].set(value)
    return surrogate.put(changes)


def _box(problem: Problem, paths, tabulated: Mapping[str, float]) -> tuple[Box, Float[np.ndarray, " p"]]:
    """The transform of what is moved, and where it begins."""
    lower, upper, scale, x = [], [], [], []
    for path in paths:
        low, high = (0.0, np.inf) if path == FACTOR else problem.bound(path)
        lower.append(low), upper.append(high)
        scale.append(1.0 if path == FACTOR else problem.scale(path))
        x.append(1.0 if path == FACTOR else tabulated.get(path, problem.start[path]))
    return Box(lower, upper, scale, sticks=problem.sticks(paths)), np.array(x)


def _inside(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    return {p: float(np.clip(v, *problem.bound(p))) for p, v in values.items()}

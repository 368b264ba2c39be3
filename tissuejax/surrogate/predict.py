"""A surrogate's prediction of a recording: a `Recording` like any other, quick, and differentiable in the surrogate's
leaves and the path. Good as a cheap first model of a fit: `predicted(made.put({"factor": f, "memory.g": g}), ...)`."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.errors import InputError
from tissuejax.experiments.probing_sensors import read_at, smooth_path
from tissuejax.mesh.columns import Lobe
from tissuejax.recordings.recording import Channel, Recording
from tissuejax.surrogate.surrogate import Surrogate

CLOCK = 0.008  # s between two evaluations
SMOOTHING = 0.04  # s, of the recorded path, as in the full model
GIVE = 4  # rounds in which force and a machine that gives way agree


def true_path(surrogate: Surrogate, time: Float[Array, " n"], path: Float[Array, "n 3"], clock: Float[Array, " m"]):
    """Where the ball truly was at `clock`, from the commanded path: mounted aside, delayed."""
    late = clock - surrogate.rig.delay
    moved = jnp.stack([jnp.interp(late, time, path[:, i]) for i in range(3)], 1)
    return moved + surrogate.rig.offset


@eqx.filter_jit
def force_along(surrogate: Surrogate, clock: Float[Array, " n"], path: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """Force along a path, the machine giving way by its compliance."""

    def again(_, force):
        return surrogate.respond(clock, path + surrogate.rig.compliance * force)

    first = surrogate.respond(clock, path)
    gives = jnp.any(surrogate.rig.compliance != 0)
    return jax.lax.cond(gives, lambda f: jax.lax.fori_loop(0, GIVE, again, f), lambda f: f, first)


def within_box(surrogate: Surrogate, recording: Recording) -> tuple[Float[Array, " n"], Float[Array, "n 3"]]:
    """Times of evaluation, s, and where the ball truly was, m.

    Raises:
        InputError: a path that leaves the box the surrogate was made for.
    """
    time, path = smooth_path(recording, SMOOTHING)
    clock = jnp.arange(time[0], time[-1] + CLOCK, CLOCK)
    true = true_path(surrogate, jnp.asarray(time), jnp.asarray(path), clock)
    _refuse_outside(surrogate, recording.name, np.asarray(true))
    return clock, true


def predicted(surrogate: Surrogate, recording: Recording, lobe: Lobe | None = None) -> Recording:
    """What the sensors of a probing would report; markers too where the organ's map is given.

    Args:
        recording: its probe path and the times of its channels.
        lobe: with it markers are placed on the top; without it only the force is predicted.

    Raises:
        InputError: a path that leaves the box the surrogate was made for.
    """
    clock, true = within_box(surrogate, recording)
    force = force_along(surrogate, clock, true)
    channels = {}
    for name, channel in recording.channels.items():
        at = jnp.asarray(np.asarray(channel.time, float))
        if name == "force":
            channels[name] = Channel(channel.time, read_at(at, clock, force), channel.unit)
        elif name == "markers" and lobe is not None:
            rest = np.nanmedian(np.asarray(channel.values, float)[: max(5, len(channel.time) // 50)], axis=0)
            where = np.array([lobe.parameters_of(p[:2]) if np.isfinite(p).all() else (0.5, 0.5) for p in rest])
            moved = markers_along(surrogate, read_at(at, clock, true), jnp.asarray(where))
            channels[name] = Channel(channel.time, rest + moved, channel.unit)
    return Recording(recording.name, recording.experiment, recording.inputs, channels, recording.attributes)


@eqx.filter_jit
def markers_along(
    surrogate: Surrogate, path: Float[Array, "n 3"], places: Float[Array, "k 2"]
) -> Float[Array, "n k 3"]:
    """Displacement of markers along a path."""
    return surrogate.displacement(path, places)


def _refuse_outside(surrogate: Surrogate, name: str, path: np.ndarray) -> None:
    low, high = np.asarray(surrogate.low), np.asarray(surrogate.high)
    xy = np.clip(path[:, :2], low, high)
    depth = surrogate.touch.sample(xy)[:, 0] - path[:, 2]
    touching = depth > 0
    if not touching.any():
        return
    beyond = np.abs(path[touching, :2] - xy[touching]).max()
    if beyond > 1e-4:
        raise InputError(
            f"recording {name}: its probe goes {1e3 * beyond:.1f} mm beyond the sides of the surrogate's box; "
            "precompute one around its site (--recording NAME, a larger --reach)"
        )
    if depth.max() > float(surrogate.depth) * 1.001:
        raise InputError(
            f"recording {name}: its probe goes {1e3 * depth.max():.2f} mm deep, the surrogate "
            f"{1e3 * surrogate.depth:.2f} mm; precompute one with a larger --depth"
        )

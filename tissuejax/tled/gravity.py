"""The stress-free shape of an organ that was measured as it lay there, settled under its own weight.

Reversing gravity and applying it again is only approximate (source 2.2.4). Here the shape X is sought from which
gravity settles the organ to the measured x: X <- X - (X + u(X) - x), u(X) by dynamic relaxation, until it comes back.
The derivative is that of the inverse equilibrium: f_int(X, x - X) = weight(X) at the nodes that are free, solved once
more for dX, so a fit carries it whenever the material changes.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.errors import InputError, NotConverged
from tissuejax.tled import statics, verdict
from tissuejax.tled.scene import Scene
from tissuejax.tled.simulate import COMPILER_OPTIONS

MISS = 1e-4  # of the body's height: gravity has brought the measured shape back


class StressFree(NamedTuple):
    """The scene in its stress-free shape with `body.settled` filled in, and how far gravity misses the measured shape:
    greatest distance, m; `sag`: greatest displacement that gravity makes, m."""

    scene: Scene
    miss: Float[Array, ""]
    sag: Float[Array, ""]


def _alone(scene: Scene, points: Float[Array, "N 3"]) -> Scene:
    return scene.put({"probe": None, "markers": None, "body.points": points, "body.settled": None})


def stress_free(scene: Scene, rounds: int = 12, tolerance: float = 1e-8) -> StressFree:
    """The stress-free shape of a scene whose `body.points` are the measured, settled ones. Pure JAX.

    Args:
        scene: with gravity.
        rounds: fixed-point rounds at most; each starts from the last equilibrium.
        tolerance: of each equilibrium.

    Returns:
        the scene with `points` stress-free, `settled` = measured - stress-free, and markers' rest moved along, so that
        they are where they were measured once the organ has settled.
    """
    if scene.gravity is None:
        raise InputError("a stress-free shape needs gravity: set scene.gravity, for example (0, 0, -9.81) m/s^2")
    scene = scene.put({"body.element": scene.body.element.general}).cast(scene.body.points.dtype)
    measured = scene.body.points
    frozen = jax.lax.stop_gradient(scene)

    def settle(points, guess):
        bare = _alone(frozen, points).put({"body.settled": guess})
        return statics.equilibrium(bare, tolerance=tolerance).displacement

    def search(_, start):
        def one(carry):
            points, u, count, _ = carry
            u = settle(points, u)
            miss = points + u - frozen.body.points
            return points - miss, u, count + 1, jnp.max(jnp.abs(miss))

        def going(carry):
            return (carry[3] > 1e-7 * jnp.ptp(frozen.body.points[:, 2])) & (carry[2] < rounds)

        points, _, _, miss = jax.lax.while_loop(going, one, (start, jnp.zeros_like(start), 0, jnp.asarray(jnp.inf)))
        return points, miss

    def inverse(points):
        at = statics.load(_alone(scene, points))
        inner, outer = statics.pull(at, (measured - points).T)
        return jnp.where(at.held, (points - measured).T, inner - outer).T

    def tangent(apply, b):
        at = statics.load(_alone(frozen, frozen.body.points))
        return statics.tangent_solve(at, lambda w: apply(w.T).T, b.T, symmetric=False).T

    points, miss = jax.lax.custom_root(inverse, frozen.body.points, search, tangent, has_aux=True)
    settled = measured - points
    changes = {"body.points": points, "body.settled": settled}
    if scene.markers is not None:
        at_markers = jnp.einsum("kv,kvi->ki", scene.markers.weights, settled[scene.markers.nodes])
        changes["markers.rest"] = scene.markers.rest - at_markers
    sag = jnp.max(jnp.linalg.norm(settled, axis=1))
    return StressFree(scene.put(changes), miss, sag)


compiled = jax.jit(stress_free, compiler_options=COMPILER_OPTIONS, static_argnames=("rounds",))


def checked(found: StressFree, scene: Scene) -> StressFree:
    """`found`, or the sentence that says why there is no stress-free shape of `scene` (host side).

    Raises:
        NotConverged: gravity could not be balanced, or did not bring the measured shape back.
    """
    size = float(jnp.ptp(scene.body.points[:, 2]))
    if not bool(jnp.isfinite(found.miss)):
        raise NotConverged("no stress-free shape: under gravity the tissue finds no rest. " + verdict.weight(scene))
    if float(found.miss) > MISS * size:
        raise NotConverged(
            f"no stress-free shape: at the last round gravity misses the measured one by {1e3 * float(found.miss):.3g} "
            "mm. Allow more rounds. " + verdict.weight(scene)
        )
    return found

"""How large a step may be: from the wave speed and shape of each element, in advance of the run.

With wave speed c = sqrt((K + 4/3 mu) / rho) plane waves in a mesh reach omega = c sqrt(steepness), which is 2 c/L in
cubes of side L, and a step must stay below 2 / omega (Flanagan & Belytschko 1984). Free corners vibrate a little
faster (measured: 1.02 times), strong compression shortens waves: `build.SAFETY` covers both. Contact adds static mass
on its nodes such that its own bound is the run's step. Internal forces taken at u + beta v shorten the step to
2/omega (sqrt(1 + xi^2) - xi) with xi = omega beta / 2.

That is foreseen. What a body bears as it is now, pressed or not, is measured by `fastest`.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.tled import internal
from tissuejax.tled.scene import Scene

ROUNDS = 100  # of power iteration: 1 % below the greatest frequency at most, in meshes of some thousand elements


def wave_modulus(scene: Scene) -> Float[Array, ""]:
    """K + 4/3 mu at rest, Pa."""
    tissue = scene.tissue
    bulk = tissue.volumetric.bulk_modulus(tissue.volumetric_values)
    return bulk + 4 / 3 * tissue.energy.initial_shear_modulus(tissue.energy_values)


def steepness(scene: Scene, mesh: internal.Mesh) -> Float[Array, " E"]:
    """Steepness of each element with its hourglass control, 1/m^2."""
    tissue = scene.tissue
    shear = tissue.energy.initial_shear_modulus(tissue.energy_values)
    return scene.body.element.steepness(mesh.reference, scene.settings.hourglass * shear / wave_modulus(scene))


def critical_steps(scene: Scene, mesh: internal.Mesh | None = None) -> Float[Array, " E"]:
    """Greatest stable step of each element, s, on the simulated clock."""
    mesh = internal.mesh(scene) if mesh is None else mesh
    count = len(scene.body.cells)
    modulus = wave_modulus(scene) * scene.stiffness
    omega = jnp.sqrt(modulus / scene.tissue.density * steepness(scene, mesh)[:count])
    xi = 0.5 * omega * scene.settings.stiffness_damping
    return 2 / omega * (jnp.sqrt(1 + xi * xi) - xi)


def nodal_stiffness(scene: Scene, mesh: internal.Mesh) -> Float[Array, " N"]:
    """Upper estimate of the stiffness that a node feels when it alone moves, N/m: the diagonal of the tangent."""
    k = mesh.cells.shape[0]
    steep = steepness(scene, mesh) * mesh.reference.volume * mesh.stiffness / k
    diagonal = jnp.broadcast_to(wave_modulus(scene) * steep, (k, len(steep)))
    return internal.add(diagonal, mesh.cells, len(mesh.mass))


def fastest(
    force: Callable[[Float[Array, "3 N"]], Float[Array, "3 N"]], mass: Float[Array, " N"], held: Array, u: Array
) -> Float[Array, ""]:
    """Greatest angular frequency of small vibrations about `u`, rad/s, by power iteration of M^-1 dforce/du.

    Args:
        force: what resists, N, of the displacement (3, N), m. held: where it can't move. mass: kg.
    """

    def once(v):
        return jnp.where(held, 0.0, jax.jvp(force, (u,), (v,))[1] / mass)

    def normed(_, v):
        w = once(v)
        return w / jnp.sqrt(jnp.sum(w * w))

    first = jnp.where(held, 0.0, jax.random.normal(jax.random.key(0), u.shape, u.dtype))
    v = jax.lax.fori_loop(0, ROUNDS, normed, first)
    return jnp.sqrt(jnp.abs(jnp.sum(v * once(v) * mass) / jnp.sum(v * v * mass)))

"""How large a step may be: from the wave speed and shape of each element, in advance of the run.

With wave speed c = sqrt((K + 4/3 mu) / rho) plane waves in a mesh reach omega = c sqrt(steepness), which is 2 c/L in
cubes of side L, and a step must stay below 2 / omega (Flanagan & Belytschko 1984). Free corners vibrate a little
faster (measured: 1.02 times), strong compression shortens waves: `build.SAFETY` covers both. Contact adds static mass
on its nodes such that its own bound is the run's step. Internal forces taken at u + beta v shorten the step to
2/omega (sqrt(1 + xi^2) - xi) with xi = omega beta / 2.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.tled import internal
from tissuejax.tled.scene import Scene


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

"""A law that is not split into shape and volume: its stress in closed form, and that of rest."""

import jax
import jax.numpy as jnp
import numpy as np

from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.unsplit import Unsplit
from tissuejax.energies.volumetric import Logarithmic
from tissuejax.mesh.columns import box
from tissuejax.tled import build, internal


def test_bonet_and_woods_law_has_its_stress(rng):
    """S = mu (1 - C^-1) + lambda ln J C^-1, at strains with volume changes of some ten per cent; none at rest."""
    mu, lam = 700.0, 2500.0
    scene = build.scene(
        box((0.02, 0.02, 0.02), (2, 2, 2)),
        build.Tissue(NeoHookean(), Logarithmic(), {"mu": mu}, {"K": lam}, 1e3),
        np.arange(2.0),
    )
    scene = scene.put({"tissue.added": (Unsplit(jnp.asarray(mu)),)})
    mesh = internal.mesh(scene)
    F = np.eye(3)[:, :, None] + 0.15 * rng.normal(size=(3, 3, mesh.stiffness.size))
    F[:, :, 0] = np.eye(3)
    assert np.ptp(np.linalg.det(F.transpose(2, 0, 1))) > 0.3
    history = internal.rest(scene, mesh)
    S, _ = jax.jit(lambda F: internal.stress(scene, mesh, internal.cauchy_green(F), history, 0.1))(jnp.asarray(F))
    for e in range(len(scene.body.cells)):  # the others are padding
        C = F[:, :, e].T @ F[:, :, e]
        inverse = np.linalg.inv(C)
        expected = mu * (np.eye(3) - inverse) + lam * 0.5 * np.log(np.linalg.det(C)) * inverse
        found = [float(x[e]) for x in S]
        np.testing.assert_allclose(found, expected[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], rtol=1e-9, atol=1e-9 * mu)

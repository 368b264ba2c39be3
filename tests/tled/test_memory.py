"""Every memory of the tissue against its own formula at one step, all of them on together."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import erf

from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.tled import internal
from tissuejax.tled.history import Damage, Prony


def test_stress_with_prony_drain_and_both_kinds_of_softening(rng):
    """S = (1 - d) S_iso - sum g q + U - sum g2 q2, 1 - d = (1 - a (1 - exp(-m/s))) (1 - r erf((m - psi)/(s + b m)))
    (Simo 1987; Ogden & Roxburgh 1999) and q <- q + (1 - exp(-h/tau)) (S - q)."""
    scene = cases.plain(box((0.02, 0.02, 0.02), (2, 2, 2)), np.arange(2.0), order=2)
    a, s, r, b, h = 0.3, 40.0, 0.4, 0.1, 0.05
    full = scene.put(
        {
            "tissue.prony": Prony(jnp.array([0.2]), jnp.array([0.3])),
            "tissue.drain": Prony(jnp.array([0.5]), jnp.array([0.1])),
            "tissue.damage": Damage(*(jnp.asarray(x) for x in (a, s, r, b))),
        }
    )
    mesh = internal.mesh(scene)
    E = mesh.stiffness.size
    F = jnp.eye(3)[:, :, None] + 0.1 * jnp.asarray(rng.normal(size=(3, 3, E)))
    C = internal.cauchy_green(F)
    old = [jnp.asarray(x) for x in rng.normal(size=(12, E)) * 50]
    most = jnp.asarray(rng.uniform(0, 200, E))
    before = internal.History([tuple(old[:6])], most, [tuple(old[6:])])
    S, after = jax.jit(lambda C: internal.stress(full, mesh, C, before, h))(C)
    psi, iso = internal.isochoric(scene, mesh, C)
    whole, _ = internal.stress(scene, mesh, C, internal.History(None, None), h)
    m = np.maximum(most, psi)
    kept = (1 - a * (1 - np.exp(-m / s))) * (1 - r * erf((m - psi) / (s + b * m)))
    n = len(scene.body.cells)  # the others are padding without stiffness
    for i in range(6):
        soft = kept * iso[i]
        q = old[i] + (1 - np.exp(-h / 0.3)) * (soft - old[i])
        U = whole[i] - iso[i]
        qd = old[6 + i] + (1 - np.exp(-h / 0.1)) * (U - old[6 + i])
        assert np.allclose(S[i][:n], (soft - 0.2 * q + U - 0.5 * qd)[:n], rtol=1e-9, atol=1e-9)
        assert np.allclose(after.relaxed[0][i][:n], q[:n])
        assert np.allclose(after.drained[0][i][:n], qd[:n])
    assert np.allclose(after.greatest[:n], m[:n])


def test_a_stiffer_place_softens_as_tissue_of_that_stiffness_does(rng):
    """Thrice the energy that it has seen and thrice the energy now: it loses the same share, of thrice the stress."""
    scene = cases.plain(box((0.02, 0.02, 0.02), (2, 2, 2)), np.arange(2.0), order=2)
    full = scene.put({"tissue.damage": Damage(*(jnp.asarray(x) for x in (0.3, 40.0, 0.4, 0.1)))})
    mesh = internal.mesh(scene)
    stiff = mesh._replace(stiffness=3.0 * mesh.stiffness)
    C = internal.cauchy_green(jnp.eye(3)[:, :, None] + 0.1 * jnp.asarray(rng.normal(size=(3, 3, mesh.stiffness.size))))
    most = jnp.asarray(rng.uniform(0, 200, mesh.stiffness.size))
    S, after = internal.stress(full, mesh, C, internal.History(None, most), 0.05)
    thrice, then = internal.stress(full, stiff, C, internal.History(None, 3.0 * most), 0.05)
    n = len(scene.body.cells)
    for one, other in zip(S, thrice, strict=True):
        assert np.allclose(other[:n], 3.0 * one[:n], rtol=1e-9, atol=1e-9)
    assert np.allclose(then.greatest[:n], 3.0 * after.greatest[:n])
    assert np.any(after.greatest[:n] > most[:n]), "some are loaded"
    assert np.any(after.greatest[:n] == most[:n]), "others unloaded"

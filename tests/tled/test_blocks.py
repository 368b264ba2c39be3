"""A large body is taken in blocks of elements; that changes neither its forces nor their derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.tled import internal
from tissuejax.tled.history import Prony
from tissuejax.tled.simulate import COMPILER_OPTIONS


@pytest.mark.parametrize("count", [1, 512, 513, 1000, 1536, 3872, 27000])
def test_blocks_are_whole_lines_no_longer_than_allowed(count):
    whole, n = internal.padded(count), internal.blocks(count)
    assert internal.blocks(whole) == n
    assert whole % (n * internal.LINE) == 0
    assert 0 <= whole - count < n * internal.LINE
    assert n == 1 or whole // n <= internal.BLOCK


def test_forces_memory_and_their_derivatives_are_those_of_all_elements_at_once(monkeypatch, rng):
    prony = Prony(jnp.array([0.3]), jnp.array([0.5]))
    body = box((0.05, 0.05, 0.03), (7, 6, 5))
    scene = cases.plain(body, np.arange(2.0), order=2)
    scene = scene.put({"tissue.prony": prony})
    u, du = (1e-4 * rng.normal(size=(3, len(body.points))) for _ in range(2))

    @partial(jax.jit, compiler_options=COMPILER_OPTIONS)
    def derived(scene, u, du):
        mesh = internal.mesh(scene)

        def forces(u):
            f, history = internal.forces(scene, mesh, u, internal.rest(scene, mesh), 1.0)
            return f, jax.tree.map(lambda a: a[:210], history)

        told, slopes = jax.jvp(forces, (u,), (du,))
        return told, slopes, jax.vjp(lambda u: forces(u)[0], u)[1](told[0])[0]

    def all_of_it():
        derived.clear_cache()  # the blocks are chosen when it is traced
        return jax.tree.leaves(derived(scene, u, du))

    monkeypatch.setattr(internal, "BLOCK", 256)
    assert internal.blocks(210) == 1
    whole = all_of_it()
    monkeypatch.setattr(internal, "BLOCK", 64)
    assert internal.blocks(210) == 4
    for one, other in zip(whole, all_of_it(), strict=True):
        assert np.allclose(one, other, rtol=1e-11, atol=1e-12 * np.abs(one).max())
        assert np.abs(one).max() > 0

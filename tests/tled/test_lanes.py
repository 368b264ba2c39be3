"""The element loop in C computes what JAX computes of the same lane, and so do its derivatives, whatever is in it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.tled import internal, native
from tissuejax.tled.history import Damage, Prony
from tissuejax.tled.lanes import library, loop

pytestmark = pytest.mark.skipif(library.compiler() is None, reason="no C compiler here")


@pytest.fixture(autouse=True)
def asked_for(monkeypatch):
    """The loop in C is on."""
    monkeypatch.setattr(native, "wanted", lambda: True)


@pytest.fixture(scope="module")
def set_up():
    """A scene whose elements have memory, bent by a random displacement; forces by C and by XLA."""
    body = box((0.04, 0.04, 0.04), (4, 4, 4))
    scene = cases.plain(body, np.arange(2.0), order=2)
    wide = scene.body.cells.astype(jnp.int64)  # as meshes from elsewhere have them; the C reads 32 bits
    scene = scene.put({"tissue.prony": Prony(jnp.array([0.3]), jnp.array([0.5])), "body.cells": wide})
    rng = np.random.default_rng(4)
    u = jnp.asarray(1e-3 * rng.normal(size=(3, len(body.points))))

    def forces(x, u, by_c: bool):
        values = {k: x[i] * v for i, (k, v) in enumerate(scene.tissue.energy_values.items())}
        here = scene.put({"tissue.energy_values": values, "settings.hourglass": x[-1]})
        mesh = internal.mesh(here)
        rest = internal.rest(here, mesh)
        if by_c:
            f, history = native.loop(internal.by_element, here, mesh, rest)(u, 0.1)
        else:
            fe, history = internal.contributions(here, mesh, list(u), rest, 0.1)
            f = jnp.stack([internal.add(g, mesh.cells, len(mesh.mass)) for g in fe])
        return f, jnp.stack(history.relaxed[0])

    return forces, jnp.array([1.0, 1.2, 0.3]), u, jnp.asarray(rng.normal(size=u.shape))


def _pulled(forces, by_c, w):
    return lambda x, u: jnp.vdot(w, forces(x, u, by_c)[0]) + jnp.sum(forces(x, u, by_c)[1])


@pytest.mark.parametrize(
    "derived",
    [
        lambda f, w, by_c: lambda x, u: f(x, u, by_c),
        lambda f, w, by_c: lambda x, u: jax.jacfwd(lambda x: f(x, u, by_c))(x),
        pytest.param(
            lambda f, w, by_c: (
                lambda x, u: jax.vmap(jax.grad(_pulled(f, by_c, w), (0, 1)), (0, None))(jnp.stack([x, 1.1 * x]), u)
            ),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["forces", "Jacobian", "batch of gradients"],
)
def test_what_c_computes_is_what_xla_computes(set_up, derived):
    forces, x, u, w = set_up
    ours, known = (jax.jit(derived(forces, w, by_c))(x, u) for by_c in (True, False))
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(known), strict=True):
        assert np.abs(b).max() > 0
        assert np.allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


def test_operations_without_a_form_in_c_are_left_to_jax():
    cells = jnp.asarray(np.random.default_rng(0).integers(0, 50, (4, 64)), jnp.int32)
    x, stiffness = jnp.linspace(0.1, 0.9, 50)[None], jnp.linspace(1.0, 2.0, 64)

    def lane(x, stiffness):
        return [stiffness * jax.lax.cumsum(jnp.tanh(x), 1), stiffness**2 * jnp.sum(x, (0, 1))]

    def told(x, stiffness):
        kernel = loop.trace(
            lane, 4, [loop.Slot("nodal", (1,)), loop.Slot("lane", ())], ["nodal", "lane"], x.dtype
        )  # fmt: skip
        return loop.loop_p.bind(cells, x, stiffness, kernel=kernel, batched=(False, False), count=50)

    f, s = jax.jit(told)(x, stiffness)
    by_hand = np.zeros(50)
    for e in range(64):
        np.add.at(by_hand, cells[:, e], stiffness[e] * np.cumsum(np.tanh(np.asarray(x[0])[cells[:, e]])))
    assert np.allclose(f[0], by_hand, rtol=1e-12)
    assert np.allclose(s, stiffness**2 * np.asarray(x[0])[np.asarray(cells)].sum(0), rtol=1e-12)


@pytest.mark.parametrize(("chosen", "wanted"), [("", False), ("off", False), ("on", True)])
def test_it_is_used_where_it_was_asked_for(monkeypatch, chosen, wanted):
    monkeypatch.undo()
    monkeypatch.setenv(library.ENVIRONMENT, chosen)
    assert native.wanted() is wanted


class More(eqx.Module):
    """A further energy, amount (I1bar - 3)^2."""

    amount: jax.Array

    def __call__(self, strain):
        return self.amount * (strain.I1 - 3.0) ** 2


MEMORIES = {
    "prony": {"tissue.prony": Prony(jnp.zeros(2), jnp.array([0.3, 2.0]))},
    "drain": {"tissue.drain": Prony(jnp.zeros(1), jnp.array([0.3]))},
    "recoverable": {"tissue.damage": Damage(jnp.asarray(0.0), jnp.asarray(50.0), jnp.asarray(0.0), jnp.asarray(0.1))},
    "added": {"tissue.added": (More(jnp.asarray(0.0)),)},
}


@pytest.mark.parametrize("name", sorted(MEMORIES))
def test_a_memory_at_its_neutral_value_changes_no_bit_of_the_forces(name, rng):
    """No product is fused into a sum and nothing is reordered: what adds zero leaves the rest as it is."""
    scene = cases.plain(cases.bent(), np.arange(2.0), order=2)
    u = jnp.asarray(1e-3 * rng.normal(size=(3, len(scene.body.points))))

    def forces(scene):
        mesh = internal.mesh(scene)
        found = native.loop(internal.by_element, scene, mesh, internal.rest(scene, mesh))
        return found(u, 0.1)[0]

    assert np.array_equal(forces(scene), forces(scene.put(MEMORIES[name])))

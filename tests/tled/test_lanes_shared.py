"""A long loop in C is taken in parts: what JAX computes, and bit for bit the same on one thread and on two."""

import ctypes
import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.tled import build
from tissuejax.tled.lanes import library, loop, share
from tissuejax.tled.simulate import COMPILER_OPTIONS, simulate

pytestmark = pytest.mark.skipif(library.compiler() is None, reason="no C compiler here")
NODES = 5000


def lane(x, scale, stiffness):
    """Nodal, by element and summed."""
    y = stiffness * jnp.tanh(scale * x)
    return [y * jnp.sum(x, (0, 1)), y[0, 0] ** 2, jnp.sum(y)]


def made(count: int):
    """The kernel and its arguments; so many elements."""
    slots = [loop.Slot("nodal", (2,)), loop.Slot("uniform", ()), loop.Slot("lane", ())]
    kernel = loop.trace(lane, 4, slots, ["nodal", "lane", "uniform"], jnp.float64)
    rng = np.random.default_rng(0)
    near = np.arange(count) * (NODES - 50) // count  # a part meets some of the nodes, and two share some
    cells = jnp.asarray(near + rng.integers(0, 50, (4, count)), jnp.int32)
    x, stiffness = rng.normal(size=(2, NODES)), rng.uniform(1.0, 2.0, count)
    return kernel, cells, [jnp.asarray(x), jnp.asarray(0.7), jnp.asarray(stiffness)]


def test_parts_follow_from_the_number_of_elements_alone():
    assert [share.parts(n) for n in (32, 1000, share.SHARED - 1, share.SHARED, 10**6)] == [1, 1, 1, 2, 2]


@pytest.mark.parametrize("count", [share.SHARED, share.SHARED + 75], ids=["whole blocks", "a last block that overlaps"])
def test_a_loop_in_parts_computes_what_jax_computes(count):
    kernel, cells, arguments = made(count)
    settled = dict(kernel=kernel, batched=(False,) * 3, count=NODES)

    def all_of(f):
        def pulled(*a):
            return sum(jnp.sum(jnp.sin(y)) for y in f(cells, *a, **settled))

        def moved(d):
            scaled = lambda s: f(cells, arguments[0], s, arguments[2], **settled)  # noqa: E731
            return jax.jvp(scaled, (arguments[1],), (d,))

        along = jax.vmap(moved, out_axes=(None, 0))(jnp.array([1.0, -2.0, 0.5]))
        return along, jax.grad(pulled, (0, 1, 2))(*arguments)

    ours, known = (jax.jit(lambda f=f: all_of(f))() for f in (loop.loop_p.bind, loop.plain))
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(known), strict=True):
        assert np.abs(b).max() > 1e-3
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())


def test_on_two_threads_each_bit_is_that_of_one(monkeypatch):
    """A program of other text is another program, which asks anew how many threads it may have."""

    def results(patience: int, until: int):
        monkeypatch.setattr(share, "PATIENCE", patience)
        kernel, cells, arguments = made(100_000)
        run = jax.jit(lambda *a: loop.run(kernel, cells, a, NODES))
        found, program = [], library._loaded[kernel.name("float64", (False,) * 3)]
        helped = ctypes.c_int64.in_dll(program, "helped")
        while len(found) < 100 and (not found or helped.value < until):
            found.append([np.asarray(x).tobytes() for x in run(*arguments)])
        return found, helped.value

    monkeypatch.delenv("XLA_FLAGS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    (alone,), helped = results(1, 0)
    assert helped == 0
    monkeypatch.delenv("OMP_NUM_THREADS")
    both, helped = results(0, 3)
    assert all(one == alone for one in both)
    if len(os.sched_getaffinity(0)) > 1:
        assert helped >= 1


@pytest.mark.parametrize(("options", "shared"), [(COMPILER_OPTIONS, False), ({}, True)], ids=["ours", "XLA's own"])
def test_sums_over_the_nodes_are_not_shared(options, shared):
    """XLA's parts of an operation, which a step of some 9,000 nodes waits for longer than they save."""
    material = build.Tissue(NeoHookean(), Quadratic(), dict(mu=1e3), dict(K=2e4), 1e3)
    scene = build.scene(box((0.1, 0.1, 0.1), (20, 20, 20)), material, np.arange(3) / 60).cast(jnp.float32)
    program = jax.jit(simulate, compiler_options=options).lower(scene).compile()
    assert ("outer_dimension_partitions" in program.as_text()) == shared or len(os.sched_getaffinity(0)) == 1

"""Forces from outside: resultants, the gradient of the enclosed volume, closed forms of the stress, momentum."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tests.tled.test_laws import SIZE, block, nominal
from tissuejax.errors import InputError
from tissuejax.mesh.columns import box
from tissuejax.tled import loads, statics
from tissuejax.tled.loads import Loads
from tissuejax.tled.simulate import simulate

quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use
forces = quick(loads.forces)
ALWAYS = (jnp.array([0.0, 1.0]), jnp.ones(2))


def volume(points, cells):
    """Of trilinear hexes, by 2 x 2 x 2 Gauss points."""
    corner = np.array(
        [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    )
    total = 0.0
    for at in corner / np.sqrt(3):
        one = 1 + corner * at
        slope = np.stack([corner[:, i] * one[:, (i + 1) % 3] * one[:, (i + 2) % 3] for i in range(3)], 1) / 8
        total += np.linalg.det(np.einsum("evi,vj->eij", points[cells], slope)).sum()
    return total


def test_pressure_is_minus_the_gradient_of_the_volume(rng):
    """All round a bent and displaced body, at every node, by central differences."""
    g = cases.bent(counts=(2, 2, 2))
    scene = cases.plain(g, np.arange(2.0))
    u = 2e-3 * rng.normal(size=g.points.shape)
    everywhere = loads.facets(scene, lambda x: x[:, 0] > -1)
    f = forces(Loads(*ALWAYS, facets=everywhere, pressure=300.0), scene.body.points, jnp.asarray(u.T), 1.0)
    assert np.abs(np.asarray(f).sum(1)).max() < 1e-15
    here, cells, h = g.points + u, np.asarray(g.cells), 1e-6
    for node, axis in ((0, 0), (5, 2), (13, 1), (26, 0), (17, 2)):
        step = np.zeros_like(here)
        step[node, axis] = h
        slope = (volume(here + step, cells) - volume(here - step, cells)) / (2 * h)
        assert float(f[axis, node]) == pytest.approx(-300 * slope, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("kind", ["hexes", "tets"])
def test_a_traction_acts_on_the_stress_free_area_wherever_the_body_is(kind, rng):
    """Force and torque about the origin of an even traction on a parallelogram: those of its middle."""
    g = cases.sheared(SIZE, (3, 2, 2))
    g = cases.tets(g) if kind == "tets" else g
    scene = cases.plain(g, np.arange(2.0))
    top = np.unique(loads.facets(scene, lambda x: x[:, 2] > SIZE[2] - 1e-9))
    pull = np.array([30.0, -20.0, 50.0])
    on = Loads(*ALWAYS, facets=loads.facets(scene, lambda x: x[:, 2] > SIZE[2] - 1e-9), traction=pull)
    u = jnp.asarray(1e-3 * rng.normal(size=(3, len(g.points))))
    f = np.asarray(forces(on, scene.body.points, u, 0.5))
    edges = np.array([[SIZE[0], 0.05 * SIZE[0], 0.0], [0.1 * SIZE[1], SIZE[1], 0.0]])  # of `cases.sheared`
    total = 0.5 * np.linalg.norm(np.cross(*edges)) * pull
    np.testing.assert_allclose(f.sum(1), total, rtol=1e-12)
    middle = 0.5 * (g.points[top].min(0) + g.points[top].max(0))
    np.testing.assert_allclose(np.cross(g.points, f.T).sum(0), np.cross(middle, total), rtol=1e-9)


def test_a_gliding_block_under_load_has_the_stress_of_the_closed_form():
    """A dead traction is nominal stress, a pressure Cauchy stress: nominal over the square of the lateral stretch."""
    g, held = block((2, 1, 1))
    scene = cases.plain(g, np.arange(2.0), order=2, held=held)
    top = loads.facets(scene, lambda x: x[:, 2] > SIZE[2] - 1e-9)
    ramp = Loads(jnp.array([0.0, 2.0]), jnp.array([0.0, 2.0]), None, None, top, jnp.array([0.0, 0.0, -100.0]), 300.0)
    found = quick(statics.equilibrium)(loads.onto(scene, ramp), 1.0, tolerance=1e-9, margin=3.0)
    moved = g.points + np.asarray(statics.checked(found).displacement)
    x, y, z = np.ptp(moved, axis=0) / np.array(SIZE)
    assert x == pytest.approx(y, rel=1e-6)
    assert nominal(z) == pytest.approx(-100 - 300 * x * x, rel=1e-6)


def test_what_loads_and_the_support_give_is_the_momentum():
    """Exactly so in central differences; and a factor of 0 changes no bit."""
    times = (np.arange(9) + 0.5) * 1e-3
    scene = cases.plain(box((0.02, 0.02, 0.01), (2, 2, 2)), times, mass_damping=0.0)
    high = np.flatnonzero(np.asarray(scene.body.points)[:, 2] > 0.0099)
    force = 1e-3 * np.random.default_rng(2).normal(size=(len(high), 3))
    on = Loads(jnp.array([0.0, 4e-3]), jnp.array([0.0, 1.0]), nodes=jnp.asarray(high), force=jnp.asarray(force))
    out = quick(simulate)(loads.onto(scene, on))
    clock, start = scene.clock, np.arange(9 * scene.clock.steps) * float(scene.clock.interval) / scene.clock.steps
    given = np.interp(start, [0.0, 4e-3], [0.0, 1.0]).sum() * float(clock.step) * force.sum(0)
    taken = np.asarray(out.reaction).sum(0) * float(clock.interval)
    free = np.ones(len(scene.body.points))
    free[np.asarray(scene.body.fixed)] = 0.0
    momentum = np.asarray(out.state.v) @ (1000.0 * _nodal_volume(scene) * free)
    np.testing.assert_allclose(given - taken, momentum, rtol=1e-9, atol=1e-12 * np.abs(given).max())
    none = Loads(on.time, jnp.zeros(2), on.nodes, on.force)
    assert np.array_equal(quick(simulate)(loads.onto(scene, none)).state.u, quick(simulate)(scene).state.u)


def _nodal_volume(scene):
    share = np.zeros(len(scene.body.points))
    np.add.at(share, np.asarray(scene.body.cells).ravel(), 0.02 * 0.02 * 0.01 / 8 / 8)
    return share


def test_loads_that_can_not_be_are_refused():
    scene = cases.plain(box((0.02, 0.02, 0.01), (2, 2, 1)), np.arange(2.0))
    with pytest.raises(InputError, match=r"no boundary facet .* \[-10. -10.   0.\] to \[10. 10. 10.\] mm"):
        loads.facets(scene, lambda x: x[:, 2] > 1.0)
    with pytest.raises(InputError, match="`nodes` and `force` together"):
        loads.onto(scene, Loads(*ALWAYS, nodes=np.array([1])))
    with pytest.raises(InputError, match="`facets`"):
        loads.onto(scene, Loads(*ALWAYS, pressure=1.0))
    with pytest.raises(InputError, match="node 18 of a body that has 18"):
        loads.onto(scene, Loads(*ALWAYS, nodes=np.array([18]), force=np.zeros((1, 3))))

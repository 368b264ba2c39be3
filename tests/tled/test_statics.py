"""Static equilibrium and the stress-free shape: found, agreed with the dynamics, and differentiated."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import test_indentation as indentation
from tests.tled import cases
from tissuejax.errors import InputError, NotConverged
from tissuejax.mesh.columns import box
from tissuejax.tled import gravity, statics
from tissuejax.tled.simulate import COMPILER_OPTIONS, run

BLOCK = box((0.03, 0.03, 0.012), (3, 3, 2))
DOWN = (0.0, 0.0, -9.81)


def test_relaxation_finds_where_the_damped_motion_comes_to_rest():
    times = np.arange(1, 41) * 0.01
    scene = cases.plain(BLOCK, times, order=2, gravity=DOWN, mass_damping=80.0)
    found = statics.checked(statics.compiled(scene))
    assert float(found.residual) < 1e-9
    settled = run(scene).state.u.T
    assert np.allclose(found.displacement, settled, atol=1e-5 * float(jnp.abs(settled).max()))


def test_the_implicit_derivative_equals_difference_quotients_and_its_reverse():
    scene = cases.pressed(BLOCK)

    def outcome(x):
        changed = scene.put({"tissue.energy_values.C10": 600 * x[0], "tissue.volumetric_values.K": 15e3 * x[1]})
        found = statics.equilibrium(changed, 0.2, tolerance=1e-11)
        return jnp.concatenate([found.force, 100 * found.displacement.ravel()])

    @jax.jit
    def forward(x, d):
        return jax.jvp(outcome, (x,), (d,))

    x, h = jnp.ones(2), 1e-5
    w = jnp.cos(jnp.arange(3.0 + BLOCK.points.size))
    tangents = []
    for d in jnp.eye(2):
        exact = forward(x, d)[1]
        quotient = (forward(x + h * d, d)[0] - forward(x - h * d, d)[0]) / (2 * h)
        assert float(jnp.linalg.norm(exact - quotient) / jnp.linalg.norm(quotient)) < 1e-6
        tangents.append(exact @ w)
    gradient = jax.jit(jax.grad(lambda x: outcome(x) @ w))(x)
    assert np.allclose(gradient, tangents, rtol=1e-6)


def test_gravity_brings_the_measured_shape_back():
    scene = cases.plain(BLOCK, np.arange(2.0), order=2, gravity=DOWN)
    found = gravity.compiled(scene)
    assert float(found.sag) > 1e-4
    assert float(found.miss) < 1e-6 * float(found.sag) + 1e-9
    down = statics.checked(statics.compiled(found.scene.put({"body.settled": None})))
    back = found.scene.body.points + down.displacement
    assert np.allclose(back, BLOCK.points, atol=1e-8)


@pytest.mark.slow
def test_the_unloaded_shape_follows_the_material():
    scene = cases.plain(BLOCK, np.arange(2.0), order=2, gravity=DOWN)

    def shape(c):
        softer = scene.put({"tissue.energy_values.C10": 600 * c})
        return 1e3 * gravity.stress_free(softer, rounds=20, tolerance=1e-11).scene.body.points.ravel()

    both = jax.jit(lambda c: jax.jvp(shape, (c,), (1.0,)), compiler_options=COMPILER_OPTIONS)
    quotient = (both(1.001)[0] - both(0.999)[0]) / 2e-3
    assert float(jnp.linalg.norm(both(1.0)[1] - quotient) / jnp.linalg.norm(quotient)) < 1e-5


def test_what_has_no_answer_says_so():
    with pytest.raises(InputError, match="needs gravity"):
        gravity.stress_free(cases.plain(BLOCK, np.arange(2.0)))
    with pytest.raises(NotConverged, match="no static equilibrium after 25 iterations"):
        statics.checked(statics.compiled(cases.plain(BLOCK, np.arange(2.0), gravity=DOWN), most=25))


def test_an_answer_with_inverted_elements_is_none():
    """A ball that jumps two elements deep turns them inside out, and the search comes to rest there."""
    deep = indentation.scene((12, 9), 0.02)
    found = statics.compiled(deep, 2e-3 / 0.02, tolerance=2e-6, margin=4.0)
    with pytest.raises(NotConverged, match="inverted|burst"):
        statics.checked(found)

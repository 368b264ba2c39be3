"""Derivatives through a whole simulation against difference quotients, and slots that are neutral to the last bit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.mesh.columns import box
from tissuejax.tled.history import Damage, Prony
from tissuejax.tled.simulate import COMPILER_OPTIONS, compiled, simulate

NAMES = ("C10", "C20", "K", "friction", "g", "tau", "gravity", "density")


def everything(scene, x):
    """Contact, friction, viscosity and gravity together, all scaled by x."""
    return scene.put(
        {
            "tissue.energy_values": {"C10": 600.0 * x[0], "C20": 400.0 * x[1]},
            "tissue.volumetric_values.K": 15e3 * x[2],
            "probe.friction": 0.3 * x[3],
            "tissue.prony": Prony(x[4] * jnp.array([0.2, 0.1]), x[5] * jnp.array([0.05, 0.4])),
            "gravity": x[6] * jnp.array([0.0, 0.0, -9.81]),
            "tissue.density": 1000.0 * x[7],
        }
    )


@pytest.fixture(scope="module")
def programs():
    scene = cases.pressed(box((0.03, 0.03, 0.012), (4, 4, 2)), frames=25)

    def channels(x):
        out = simulate(everything(scene, x))
        return jnp.concatenate([out.force.ravel(), out.reaction.ravel()])

    options = dict(compiler_options=COMPILER_OPTIONS)
    tangent = jax.jit(lambda x, d: jax.jvp(channels, (x,), (d,))[1], **options)
    return scene, jax.jit(channels, **options), tangent


def test_forward_tangents_equal_difference_quotients(programs):
    """Relative 1e-6 in the norm, for each of eight parameters (issue 3, section 3)."""
    _, channels, tangent = programs
    x = jnp.ones(len(NAMES))
    for i, name in enumerate(NAMES):
        d = jnp.zeros(len(NAMES)).at[i].set(1.0)
        exact = tangent(x, d)
        gaps = []
        for h in (1e-4, 1e-5):
            quotient = (channels(x + h * d) - channels(x - h * d)) / (2 * h)
            gaps.append(float(jnp.linalg.norm(exact - quotient) / jnp.linalg.norm(quotient)))
        assert min(gaps) < 1e-6, (name, gaps)


@pytest.mark.parametrize("memory", [2**26, 0], ids=["stored", "recomputed by blocks"])
def test_reverse_equals_forward(programs, memory):
    scene, _, tangent = programs
    x = jnp.ones(len(NAMES))
    w = jnp.asarray(np.random.default_rng(1).normal(size=(scene.clock.frames, 6)))
    scene = scene.put({"settings.memory": memory})

    def misfit(x):
        out = simulate(everything(scene, x))
        return jnp.vdot(jnp.concatenate([out.force, out.reaction], 1), w)

    order = jnp.concatenate([w[:, :3].ravel(), w[:, 3:].ravel()])
    forward = jnp.stack([tangent(x, d) @ order for d in jnp.eye(len(NAMES))])
    assert np.allclose(jax.jit(jax.grad(misfit), compiler_options=COMPILER_OPTIONS)(x), forward, rtol=1e-9)


SLOTS = {
    "prony": {"tissue.prony": Prony(jnp.zeros(1), jnp.array([0.3]))},
    "damage": {"tissue.damage": Damage(jnp.asarray(0.0), jnp.asarray(50.0))},
    "recoverable": {
        "tissue.damage": Damage(jnp.asarray(0.0), jnp.asarray(50.0), jnp.asarray(0.0), jnp.asarray(0.1)),
    },
    "drain": {"tissue.drain": Prony(jnp.zeros(1), jnp.array([0.3]))},
    "friction": {"probe.friction": jnp.asarray(0.0)},
    "adhesion": {"probe.adhesion": jnp.asarray(0.0)},
    "offset": {"probe.offset": jnp.zeros(3)},
    "compliance": {"probe.compliance": jnp.asarray(0.0)},
    "capsule": {"tissue.capsule": jnp.asarray(0.0)},
    "bedding": {"support.compliance": jnp.asarray(0.0)},
    "fluid bedding": {"support.fluidity": jnp.asarray(0.0)},
    "motion": {"support.time": jnp.array([0.0, 1.0]), "support.displacement": jnp.zeros((2, 3))},
    "gravity": {"gravity": jnp.zeros(3)},
}


# A support's motion of zero is rounded as without it in optimized code alone (else 7e-16 N of 0.2 N apart).
ROUNDED = {"motion"}
AS_USERS_DO = {"xla_backend_optimization_level": "3", "xla_llvm_disable_expensive_passes": False}
optimized = jax.jit(simulate, compiler_options=COMPILER_OPTIONS | AS_USERS_DO)


@pytest.fixture(scope="module")
def bare():
    scene = cases.pressed(box((0.03, 0.03, 0.012), (3, 3, 2)), frames=9)
    stiffness = {"tissue.stiffness": jnp.ones(len(scene.body.cells))}
    return scene, compiled(scene), stiffness


@pytest.mark.parametrize("name", sorted(SLOTS))
def test_a_slot_at_its_neutral_value_changes_nothing_to_the_last_bit(bare, name):
    scene, out, _ = bare
    run, out = (optimized, optimized(scene)) if name in ROUNDED else (compiled, out)
    other = run(scene.put(SLOTS[name]))
    assert np.array_equal(other.force, out.force), float(jnp.abs(other.force - out.force).max())
    assert np.array_equal(other.state.u, out.state.u)


def test_a_stiffness_field_of_ones_changes_nothing_to_the_last_bit(bare):
    scene, out, stiffness = bare
    assert np.array_equal(compiled(scene.put(stiffness)).force, out.force)

"""Where the work of a cut goes, from invented energies: each term has its place, and what is left over is the error."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.cohesion.catalogue import law
from tissuejax.mesh.columns import box
from tissuejax.mesh.slab import plane_slice, slice_held
from tissuejax.tled import seam, step
from tissuejax.tled.history import Prony
from tissuejax.tled.ledger import Look, Spent, balance

MEMORY = {"tissue.prony": Prony(jnp.array([0.2]), jnp.array([0.3]))}
DAMPED = {"settings.stiffness_damping": jnp.asarray(1e-5)}


@pytest.mark.parametrize("changes", [{}, MEMORY, DAMPED], ids=["elastic", "memory", "stiffness damping"])
def test_work_less_what_it_went_into_is_the_error(changes, rng):
    """Losses and works are summed over the frames, energies are those of the frame; what the tissue took beyond its
    energy is viscous where there is memory or stiffness damping, and nothing else is."""
    scene = cases.plain(box((0.02, 0.02, 0.02), (1, 1, 1)), np.arange(2.0)).put(changes)
    work, lost, friction, damping, tissue, support = rng.uniform(1, 2, (6, 5))
    looks = Look(*jnp.asarray(rng.uniform(0, 1, (8, 5))))
    found = balance(
        scene, jnp.asarray(work), Spent(*map(jnp.asarray, (lost, friction, damping, tissue, support))), looks
    )
    viscous = np.cumsum(tissue) - np.asarray(looks.elastic + looks.hourglass) if changes else np.zeros(5)
    np.testing.assert_allclose(found.viscous, viscous, atol=1e-12)
    kept = np.asarray(sum(looks[:6]))  # all but the crack
    gone = kept + np.cumsum(lost + friction + damping) + viscous
    np.testing.assert_allclose(found.accounted, gone, rtol=1e-12)
    given = np.cumsum(work + support)
    np.testing.assert_allclose(found.error, (given - gone) / given, rtol=1e-12)
    np.testing.assert_array_equal(found.front, looks.front)


def test_an_error_is_measured_by_the_most_that_was_put_in():
    """What has been given back is no smaller scale; nothing given is no division by zero."""
    scene, zero = cases.plain(box((0.02, 0.02, 0.02), (1, 1, 1)), np.arange(2.0)), jnp.zeros(3)
    none = Look(*[zero] * 8)
    work = jnp.array([4.0, -3.0, -1.0])  # 4, 1, 0 J so far
    assert np.asarray(balance(scene, work, Spent(*[zero] * 5), none).error) == pytest.approx([1.0, 0.25, 0.0])
    assert np.asarray(balance(scene, zero, Spent(*[zero] * 5), none).error) == pytest.approx(0.0)


def test_what_a_step_spends_is_what_the_speeds_lose(rng):
    """The theorem of work, exact in central differences: from the place of rest, where the faces carry nothing, the
    kinetic energy grows by the support's work less damping and what is done on the tissue (by its stiffness damping,
    from speeds at random). Damping is a h m (mean speed)^2 of what is free."""
    made, half = plane_slice(0.004, 0.002, 1e-3), 0.002
    held = slice_held(made.geometry.points, half)
    options = dict(mass_damping=900.0, stiffness_damping=1e-4, held=held, joined=seam.pairs(made))
    scene = cases.plain(made.geometry, np.arange(2.0), **options)
    scene = seam.joined(scene, made, law("bilinear"), {"strength": 4000.0, "energy": 2.0})
    pattern = jnp.asarray(held[np.asarray(made.geometry.fixed)])
    scene = scene.put(
        {"support.time": jnp.arange(2.0), "support.displacement": jnp.zeros((2, 3)), "support.pattern": pattern}
    )
    before = jnp.asarray(0.02 * rng.normal(size=(3, len(held))))

    @jax.jit
    def stepped(scene, v, motion):
        m = step.machine(scene)
        state, felt = step.advance(m, step.start(m)._replace(v=v), step.Drive(None, None, motion))
        return m.mass, state.v, step.summed(felt).spent

    h = float(scene.clock.step)
    mass, after, spent = stepped(scene, before, h * jnp.array([0.02, -0.01, 0.03]))
    gained = 0.5 * float(jnp.sum(mass * (after**2 - before**2)))
    free = np.ones_like(before)
    free[:, np.asarray(made.geometry.fixed)] -= pattern.T
    damped = 900.0 * h * float(jnp.sum(free * mass * (0.5 * (before + after)) ** 2))
    assert min(abs(damped), abs(float(spent.tissue)), abs(float(spent.support))) > 0.01 * abs(gained)
    assert float(spent.damping) == pytest.approx(damped, rel=1e-10)
    assert gained == pytest.approx(float(spent.support - spent.damping - spent.tissue), rel=1e-9)
    assert float(spent.lost) == float(spent.friction) == 0.0

"""Where the work of a cut goes, from invented energies: each term has its place, and what is left over is the error."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.mesh.columns import box
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

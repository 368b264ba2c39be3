"""A long-lived process drops its compiled programs before it has no memory map left for another one."""

import jax
import jax.numpy as jnp
import pytest

from tissuejax.cache import crowding
from tissuejax.cache.programs import Kept


@pytest.fixture
def compiled():
    """A kept function and a jitted one with forty programs each, and the calls that ask for them."""
    kept, jitted = Kept(lambda x: {"y": jnp.sin(x) @ jnp.cos(x).T}, None), jax.jit(lambda x: jnp.linalg.qr(jnp.exp(x)))
    shapes = [(n, n + 1) for n in range(2, 42)]
    for shape in shapes:
        kept(jnp.ones(shape)), jitted(jnp.ones(shape))
    return kept, jitted, shapes


@pytest.mark.skipif(not crowding.MAPS.exists(), reason="memory maps are counted on Linux alone")
def test_programs_are_dropped_where_they_crowd_the_process_and_made_again_when_asked_for(compiled):
    kept, jitted, shapes = compiled
    before = crowding.crowding()
    assert not crowding.make_room(before + 0.1)
    assert len(kept._known) == len(shapes)
    assert crowding.make_room(0.5 * before)
    assert crowding.crowding() < before - len(shapes) / int(crowding.ALLOWED.read_text())
    assert not kept._known
    assert float(kept(jnp.zeros((2, 3)))["y"].sum()) == 0.0
    assert jitted(jnp.zeros((2, 3)))[0].shape == (2, 2)


def test_where_nobody_counts_maps_nothing_is_crowded(monkeypatch, tmp_path):
    monkeypatch.setattr(crowding, "MAPS", tmp_path / "maps")
    assert crowding.crowding() == 0.0
    assert not crowding.make_room()

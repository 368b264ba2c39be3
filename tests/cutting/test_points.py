"""Points of faces and blade: a plane slice takes those on its middle line, as nothing changes across it."""

import numpy as np
import pytest

from tests.cutting import slabs
from tissuejax.tled import seam
from tissuejax.tled.simulate import run


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, 0.1])
def test_points_across_a_slice_repeat_each_other(monkeypatch, friction):
    """All 2 x 2 and 3 x 3 of them give the same forces, faces and losses, a third to a half of them as well."""
    same = dict(travel=0.006, frames=12, strength=3000.0, friction=friction)
    few = slabs.cut(**same)
    assert (len(few.faces.area), len(few.probe.area)) == (2, 3)
    monkeypatch.setattr(seam, "sliced", lambda scene: False)
    many = slabs.cut(**same)
    assert (len(many.faces.area), len(many.probe.area)) == (4, 9)
    np.testing.assert_allclose(np.sum(few.faces.area), np.sum(many.faces.area))
    np.testing.assert_allclose(few.probe.mass, many.probe.mass, atol=1e-18)
    few, many = run(few), run(many)
    np.testing.assert_allclose(few.force, many.force, atol=1e-9 * np.abs(many.force).max())
    for name in ("lost", "friction", "area"):
        a, b = (np.asarray(getattr(o.balance, name)) for o in (few, many))
        np.testing.assert_allclose(a, b, atol=1e-9 * max(b.max(), 1e-12))


def test_a_block_cut_in_part_is_no_slice():
    assert len(slabs.drawn()[0].probe.area) == 9

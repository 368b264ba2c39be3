"""A recording with `probe/edge` is that of a flat punch, from its first touch to the scene."""

import numpy as np
import pytest

from tests.probing import bench
from tissuejax.errors import InputError
from tissuejax.experiments.probing_sensors import surface_gap
from tissuejax.experiments.probing_setup import setups
from tissuejax.mesh.facets import boundary, facing_up
from tissuejax.tled.shapes import Punch, Sphere


def made(**attributes):
    sample = bench.sample(bench.recording(**attributes))
    return setups(bench.model(), sample, ("r1",), bench.QUICK)["r1"]


def test_a_flat_punch_touches_a_plane_when_a_ball_of_its_radius_does():
    flat, ball = made(**{"probe/edge": 1e-3}), made()
    assert isinstance(flat.scene.probe.shape, Punch)
    assert isinstance(ball.scene.probe.shape, Sphere)
    assert float(flat.scene.probe.shape.edge) == pytest.approx(1e-3)
    assert float(flat.test.first_touch) == pytest.approx(float(ball.test.first_touch), abs=0.01)
    points = bench.BODY.points
    top = facing_up(points, boundary(bench.BODY.cells, "hexahedron"))
    path = np.array([[0.0, 0.0, 0.015 + 8e-3 + z] for z in (3e-3, 0.0, -2e-3)])
    gap = surface_gap(path, Punch(8e-3, 1e-3), points, top)
    np.testing.assert_allclose(gap, [3e-3, 0.0, -2e-3], atol=1e-6)


def test_an_edge_wider_than_the_punch_is_refused():
    with pytest.raises(InputError, match="more than 0 and less than its radius"):
        made(**{"probe/edge": 9e-3})

"""Markers on facets, registration, tracks from unordered detections, smoothing."""

import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.mesh.columns import box
from tissuejax.mesh.facets import Facets, boundary, facing_up, triangles
from tissuejax.mesh.markers import attach, nearest_nodes
from tissuejax.mesh.registration import register
from tissuejax.mesh.tracks import smooth, tracks

G = box((0.04, 0.03, 0.02), (4, 3, 2))
TOP = facing_up(G.points, boundary(G.cells, G.cell_type))


@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_a_marker_follows_an_affine_motion_exactly(rng, kind):
    facets = TOP if kind == "quads" else Facets(triangles(TOP.nodes), np.tile(TOP.cells, 2))
    rest = np.stack([rng.uniform(-0.019, 0.019, 30), rng.uniform(-0.014, 0.014, 30), np.full(30, 0.0203)], 1)
    on = attach(rest, G.points, facets)
    assert np.allclose(on.distance, 0.0003)
    assert np.allclose(on.weights.sum(1), 1)
    A = rng.normal(size=(3, 3))
    moved = np.einsum("kv,kvd->kd", on.weights, (G.points @ A.T)[on.nodes])
    foot = rest - [0, 0, 0.0003]
    assert np.allclose(moved, foot @ A.T, atol=1e-12)
    near = nearest_nodes(rest, G.points, facets)
    assert np.abs(np.einsum("kv,kvd->kd", near.weights, G.points[near.nodes]) - foot).max() > 1e-3


def test_markers_off_the_surface_or_never_seen_are_refused():
    with pytest.raises(InputError, match=r"marker 1 at \[0.0, 0.0, 40.0\] mm is 20.0 mm away"):
        attach([[0, 0, 0.02], [0, 0, 0.04]], G.points, TOP)
    with pytest.raises(InputError, match=r"markers \[1\] have no rest position"):
        attach([[0, 0, 0.02], [np.nan] * 3], G.points, TOP)


def rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.linalg.det(q)


def test_registration_recovers_a_rigid_motion(rng):
    a = rng.uniform(-0.05, 0.05, (7, 3))
    R, t = rotation(rng), np.array([0.1, -0.2, 0.05])
    found = register(a, a @ R.T + t)
    assert np.allclose(found.rotation, R)
    assert np.allclose(found.translation, t)
    assert found.residuals.max() < 1e-12


def test_registration_never_reflects_and_shows_the_bad_marker(rng):
    a = rng.uniform(-0.05, 0.05, (6, 3)) * [1, 1, 1e-3]  # nearly flat: noise can turn the best fit into a mirror
    b = a * [1, 1, -1]
    assert np.linalg.det(register(a, b).rotation) == pytest.approx(1)
    a = rng.uniform(-0.05, 0.05, (8, 3))
    b = a @ rotation(rng).T
    b[5] += 0.004
    b[2] = np.nan
    residuals = register(a, b).residuals
    assert np.nanargmax(residuals) == 5
    assert np.isnan(residuals[2])


@pytest.mark.parametrize(
    ("a", "b", "says"),
    [
        (np.zeros((3, 3)), np.zeros((4, 3)), "same markers"),
        (np.zeros((2, 3)), np.zeros((2, 3)), "three markers"),
        (np.outer(np.arange(5.0), [1, 2, 3]), np.zeros((5, 3)), "one line"),
    ],
)
def test_registration_errors(a, b, says):
    with pytest.raises(InputError, match=says):
        register(a, b)


def test_tracks_from_shuffled_detections_with_gaps(rng):
    frames, k = 60, 6
    start = np.stack([0.02 * np.arange(k), np.zeros(k), np.zeros(k)], 1)
    truth = start + 1e-3 * np.cumsum(rng.normal(size=(frames, k, 3)) * 0.5, 0)
    seen = rng.uniform(size=(frames, k)) > 0.1
    seen[0] = True
    seen[20:, 5] = False  # the last marker is lost after 20 frames: too few to keep
    detections = [truth[f][seen[f]][rng.permutation(seen[f].sum())] for f in range(frames)]
    out = tracks(detections)
    assert out.shape == (frames, 5, 3)
    for column in range(5):
        marker = np.nanargmin(np.linalg.norm(truth[0, :5] - out[0, column], axis=1))
        assert np.array_equal(np.isfinite(out[:, column, 0]), seen[:, marker])
        assert np.allclose(out[seen[:, marker], column], truth[seen[:, marker], marker])


def test_tracks_shorter_than_allowed_are_an_error():
    with pytest.raises(InputError, match="longest 3"):
        tracks([np.zeros((1, 3))] * 3)


def test_smoothing_keeps_a_parabola_and_gaps_and_lowers_noise(rng):
    t = np.sort(rng.uniform(0, 1, 200))
    y = np.stack([1 + 2 * t - 3 * t**2, t], 1)
    y[50] = np.nan
    s = smooth(t, y, 0.2)
    assert np.isnan(s[50]).all()
    assert np.allclose(np.delete(s, 50, 0), np.delete(y, 50, 0))
    noisy = smooth(t, rng.normal(size=200), 0.2)
    assert noisy.std() < 0.5
    with pytest.raises(InputError, match="positive"):
        smooth(t, y, 0)

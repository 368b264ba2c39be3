"""Column meshes: exact on known shapes, the same body after regrading, fine where asked."""

import numpy as np
import pytest

from tests.conftest import outside
from tissuejax.errors import InputError
from tissuejax.mesh.cloud import lobe_of_cloud
from tissuejax.mesh.columns import box, columns, lines, lobe_of_mesh, top_of
from tissuejax.mesh.facets import area_vectors, boundary, facing_up
from tissuejax.mesh.files import read_mesh, surface_of, write_mesh
from tissuejax.mesh.quality import quality, refuse_bad
from tissuejax.recordings.recording import Geometry


def dome(x, y):
    return 0.02 - 8.0 * (x**2 + y**2)


def test_box_has_its_volume_and_closed_surface():
    g = box((0.04, 0.03, 0.02), (4, 3, 2))
    assert refuse_bad(g).volume == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    facets = boundary(g.cells, g.cell_type)
    areas = area_vectors(g.points, facets.nodes)
    assert np.abs(areas.sum(0)).max() < 1e-18  # a closed surface turned outwards
    assert np.einsum("fi,fi->", areas, g.points[facets.nodes].mean(1)) / 3 == pytest.approx(
        2.4e-5
    )  # divergence theorem
    assert len(facing_up(g.points, facets).nodes) == 12
    assert surface_of(g).is_watertight


def test_regrading_keeps_the_body(rng):
    g = box((0.06, 0.05, 0.02), (14, 12, 5))
    points = g.points.copy()
    points[:, 2] *= dome(points[:, 0], points[:, 1]) / 0.02
    order = rng.permutation(len(points))  # node numbers carry no structure
    back = np.argsort(order)
    mixed = Geometry(points[order], back[g.cells][rng.permutation(len(g.cells))], "hexahedron", back[g.fixed])
    lobe = lobe_of_mesh(mixed)
    m = columns(lobe, (16, 16, 6), [np.array([0.008, -0.005])], core=0.006, ratio=3)
    exact = 0.06 * 0.05 * (0.02 - 8 * (0.06**2 + 0.05**2) / 12)
    assert refuse_bad(m).volume == pytest.approx(exact, rel=5e-3)  # chords of the dome lie under it
    top = m.points[:, 2].reshape(17, 17, 7)[:, :, -1]
    xy = m.points.reshape(17, 17, 7, 3)[:, :, -1, :2]
    assert np.abs(top - dome(xy[..., 0], xy[..., 1])).max() < 1e-7
    gaps = np.abs(np.diff(xy[:, 8, 0]))
    at = np.abs((xy[1:, 8, 0] + xy[:-1, 8, 0]) / 2 - 0.008).argmin()
    assert gaps[at] < 0.65 * 0.06 / 16  # fine at the site
    assert max(gaps[0], gaps[-1]) > 1.7 * gaps[at]
    assert set(m.points[m.fixed][:, 2]) == {0.0}


def test_lines_are_dense_at_the_site_and_uniform_without():
    assert np.allclose(lines(1.0, 8), np.linspace(0, 1, 9))
    x = lines(0.06, 20, [0.5], core=0.005, ratio=4)
    assert x[0] == 0
    assert x[-1] == 1
    assert (np.diff(x) > 0).all()
    assert np.allclose(np.diff(x), np.diff(x)[::-1], rtol=1e-3)
    assert np.diff(x).max() / np.diff(x).min() > 2.5


def test_practice_lobe_is_read_and_reproduced():
    import h5py

    with h5py.File(outside("practice", "p01.h5")) as h:
        g = Geometry(h["geometry/points"][:], h["geometry/cells"][:], "hexahedron", h["geometry/fixed"][:])
    m = columns(lobe_of_mesh(g), (22, 20, 7))
    assert quality(m).volume == pytest.approx(quality(g).volume, rel=1e-9)
    from_cloud = columns(lobe_of_cloud(top_of(g)), (16, 16, 6))
    assert refuse_bad(from_cloud).volume == pytest.approx(quality(g).volume, rel=0.12)


def test_cloud_of_a_dome_gives_its_height_and_plan(rng):
    r = 0.03 * np.sqrt(rng.uniform(size=2500))
    a = rng.uniform(0, 2 * np.pi, 2500)
    x, y = r * np.cos(a), 0.8 * r * np.sin(a)
    z = 0.02 * (1 - 0.6 * (r / 0.03) ** 2)
    lobe = lobe_of_cloud(np.stack([x, y, z + rng.normal(0, 2e-5, 2500)], 1))
    m = columns(lobe, (14, 14, 5), [np.array([0.005, 0.0])])
    q = refuse_bad(m)
    exact = 0.8 * np.pi * 0.03**2 * 0.02 * (1 - 0.3)  # paraboloid over an ellipse
    assert q.volume == pytest.approx(exact, rel=0.09)  # the plan is shrunk by 3 % of radius
    assert lobe.top.ev(0.5, 0.5) == pytest.approx(0.02, abs=2e-4)


@pytest.mark.parametrize(
    ("cloud", "says"),
    [
        (np.zeros((5, 3)), "at least 30"),
        (np.random.default_rng(0).uniform(0, 40, (100, 3)), "millimetres"),
        (np.random.default_rng(0).uniform(0, 0.04, (100, 3)) * [1, 1, -1], "below z = 0"),
    ],
)
def test_bad_clouds(cloud, says):
    with pytest.raises(InputError, match=says):
        lobe_of_cloud(cloud)


@pytest.mark.parametrize("suffix", ["vtu", "inp", "msh"])
def test_mesh_files_round_trip(tmp_path, suffix):
    g = box((0.04, 0.03, 0.02), (3, 2, 2))
    path = tmp_path / f"box.{suffix}"
    write_mesh(g, path)
    back = read_mesh(path, support=1e-6)
    assert np.allclose(back.points, g.points)
    assert np.array_equal(back.cells, g.cells)
    assert np.array_equal(back.fixed, g.fixed)


def test_mesh_file_errors(tmp_path):
    (tmp_path / "a.vtu").write_text("nothing")
    with pytest.raises(InputError, match="meshio"):
        read_mesh(tmp_path / "a.vtu")
    with pytest.raises(InputError, match="meshio"):
        read_mesh(tmp_path / "none.xyz")

"""A tangent that is kept: the same equilibrium as by a new, dense one in every iteration, with far fewer factors."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from tissuejax.challenge.banded import Band, Kept
from tissuejax.challenge.lobe import Lobe, graded
from tissuejax.challenge.probe_paths import over
from tissuejax.challenge.quasistatic import Bed, Bench
from tissuejax.challenge.solid import Solid, Tissue
from tissuejax.challenge.touch import Membrane, Sphere

LOBE, RADIUS = Lobe(0.03, 0.027, 0.09, 0.02, 0.5, 0.9, (0.0, 0.0)), 0.0095
NOISE = 3e-3, 5e-5  # of force and markers in the cases, N and m: results agree to a hundredth of it
EXACT = 1e-9  # N
KINDS = {
    "plain": (Tissue(600.0, 400.0, 3e4), 0.0, None),
    "a past, fibres and a capsule": (
        Tissue(600, 400, 3e4, g=(0.2, 0.1), tau=(0.5, 6), damage=0.3, damage_energy=30, fibre=900, along=(1, 0.5, 0)),
        0.0,
        20.0,
    ),
    "friction": (Tissue(600.0, 400.0, 3e4), 0.25, None),
}


def bench(kind: str) -> Bench:
    """A body of 6 x 6 x 3 hexes under the probe."""
    tissue, friction, skin = KINDS[kind]
    mesh = graded(LOBE, (0.0, 0.0), 6, 6, 3, 0.3, 0.3)
    near = np.linalg.norm(mesh.points[mesh.top].mean(1)[:, :2], axis=1) < 0.016
    sphere = Sphere(mesh, mesh.top[near], RADIUS, friction)
    return Bench(Solid(mesh, tissue), sphere, Bed(), Membrane(mesh, skin) if skin else None)


def path() -> tuple[np.ndarray, np.ndarray]:
    """Press, hold, glide sideways, retract; s and m."""
    top = over(LOBE, (0.0, 0.0), RADIUS)
    depths = [-2e-4, 4e-4, 1e-3, 1.7e-3, 2.4e-3, 2.4e-3, 2.4e-3, 2.4e-3, 1.5e-3, 5e-4]
    aside = [0, 0, 0, 0, 0, 0, 5e-4, 1e-3, 1e-3, 1e-3]
    return 0.3 * np.arange(1, 11), np.stack([aside, np.zeros(10), top - np.array(depths)], -1)


def plain_newton(b: Bench, times: np.ndarray, centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces on the probe and displacements by a new dense tangent in every iteration."""
    forces, moved = [], []
    for dt, centre in zip(np.diff(times, prepend=0.0), centres):
        u = b.u
        for iteration in range(300):
            b.sphere.caution = min(iteration // 12, 2)
            now = b._all(u, centre, dt)
            if np.abs(now["r"]).max() < EXACT:
                break
            K = np.diag(now["bed"])
            blocks = {"solid": b.solid.state(u, dt, True)["K"], "sphere": now["parts"]["sphere"]["K"]}
            if b.membrane:
                blocks["membrane"] = b.membrane.state(u, True)["K"]
            for name, block in blocks.items():
                dofs = b.band.dofs[name]
                np.add.at(K, (dofs[:, :, None], dofs[:, None, :]), block)
            du = np.linalg.solve(K, now["r"]).reshape(u.shape)
            u = u - min(1.0, 1e-3 / np.abs(du).max()) * du
        else:
            raise AssertionError("the plain solver found no equilibrium")
        b._accept(u, now)
        forces.append(now["parts"]["sphere"]["probe"])
        moved.append(u)
    return np.array(forces), np.array(moved)


@pytest.mark.parametrize("kind", KINDS)
def test_same_equilibrium_as_with_a_new_tangent_every_time(kind):
    times, centres = path()
    with threadpool_limits(1):
        kept = bench(kind)
        force, moved = kept.follow(times, centres, lambda u: u.copy())
        exact, u = plain_newton(bench(kind), times, centres)
    assert np.abs(exact[:, 2]).max() > 20 * NOISE[0]
    np.testing.assert_allclose(force, exact, rtol=0, atol=NOISE[0] / 100)
    np.testing.assert_allclose(moved, u, rtol=0, atol=NOISE[1] / 100)


def test_one_factor_serves_contacts_near_it(rng):
    """(M + P) x = r for a body whose contact changed: residual and solution against a dense solver."""
    mesh = graded(LOBE, (0.0, 0.0), 4, 4, 2)
    band = Band({"solid": mesh.cells, "sphere": mesh.top}, len(mesh.points))
    K = Solid(mesh, KINDS["plain"][0]).state(np.zeros_like(mesh.points), 1.0, True)["K"]
    B = rng.standard_normal((len(mesh.top), 12, 3)) * (rng.random((len(mesh.top), 1, 1)) < 0.3)
    contact = B @ np.swapaxes(B, 1, 2)
    kept = Kept(band, band.matrix("solid", K, np.full(band.n, 2.0)), np.zeros_like(contact))
    whole = np.diag(np.full(band.n, 2.0))
    for name, block in (("solid", K), ("sphere", contact)):
        dofs = band.dofs[name]
        np.add.at(whole, (dofs[:, :, None], dofs[:, None, :]), block)
    r = rng.standard_normal(band.n)
    same, other = kept.solve(r, np.zeros_like(contact)), kept.solve(r, contact)
    assert same is not None
    assert other is not None
    left = np.abs(whole @ other - r).max() / np.abs(r).max()
    assert left < 0.06  # what `NEAR` leaves, and single precision
    assert np.abs(whole @ same - r).max() / np.abs(r).max() > 0.3  # without the change it would not be a solution
    np.testing.assert_allclose(kept.back(r), same)
    assert kept.solve(r, -1e3 * contact) is None  # indefinite: a new factor

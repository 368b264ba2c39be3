"""Orders of convergence where the answer is known, and how much the contact settings matter."""

import numpy as np
import pytest

from tests.tled import cases
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.mesh.disc import disc
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, statics

SIDE = 0.02


def duct(n: int) -> float:
    """Sag of the middle of a square duct of tissue that hangs on its four walls, over the exact one, less 1.

    Antiplane shear: G laplace(u) = rho g, u = 0 on the walls; in the middle u = rho g L^2 / (2 G) (1 - 32/pi^3 sum over
    odd k of (-1)^((k-1)/2) / (k^3 cosh(k pi / 2))), L half the side (Timoshenko & Goodier, torsion of a square bar).
    """
    weight = 0.5  # m/s^2: strains below 0.3 %
    g = box((SIDE, SIDE, SIDE / n), (n, n, 1))
    walls = (np.abs(np.abs(g.points[:, :2]) - SIDE / 2) < 1e-9).any(1)
    held = np.ones((len(g.points), 3))
    held[~walls, 2] = 0.0
    whole = Geometry(g.points, g.cells, g.cell_type, np.arange(len(g.points)))
    scene = cases.plain(whole, np.arange(2.0), held=held, gravity=(0, 0, -weight))
    found = statics.checked(statics.compiled(scene, tolerance=1e-10))
    middle = np.linalg.norm(g.points[:, :2], axis=1).argmin()
    k = np.arange(1, 60, 2)
    series = 1 - 32 / np.pi**3 * np.sum((-1.0) ** ((k - 1) / 2) / k**3 / np.cosh(k * np.pi / 2))
    exact = 1000 * weight * (SIDE / 2) ** 2 / (2 * 2 * cases.NEO["C10"]) * series
    return -float(found.displacement[middle, 2]) / exact - 1


def test_second_order_in_the_mesh():
    """4, 8 and 12 elements a side: the error falls with the square of their number."""
    a, b, c = (duct(n) for n in (4, 8, 12))
    assert a / b == pytest.approx(4.0, rel=0.1)
    assert b / c == pytest.approx(1.5**2, rel=0.05)
    assert abs(c) < 1e-2


BALL, LAYER = 0.02, 0.02
MU, K = 1500.0, 20e3


def bonded(depth: float) -> float:
    """Force of a ball on a thin bonded layer, N: Hertz times a series in chi = sqrt(R d) / h, any Poisson's ratio
    (Dimitriadis et al. 2002, Biophys. J. 82, eq. 11-12)."""
    nu = (3 * K - 2 * MU) / (2 * (3 * K + MU))
    E = 2 * MU * (1 + nu)
    alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1 - nu)
    beta = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1 - nu)
    chi, pi = np.sqrt(BALL * depth) / LAYER, np.pi
    series = 1 - 2 * alpha / pi * chi + 4 * alpha**2 / pi**2 * chi**2
    series -= 8 / pi**3 * (alpha**3 + 4 * pi**2 / 15 * beta) * chi**3
    series += 16 * alpha / pi**4 * (alpha**3 + 3 * pi**2 / 5 * beta) * chi**4
    return 4 / 3 * E / (1 - nu**2) * np.sqrt(BALL) * depth**1.5 * series


def pressed(depth: float, counts, penalty: float = 1.0) -> float:
    """Force on a ball at rest in a layer of 20 mm, radius 80 mm (a quarter of it), N; `penalty` times the automatic."""
    body = disc(0.08, LAYER, counts, inward=4.2, upward=2.0)
    steps = int(np.ceil(depth / 2.5e-4))  # m at a time: a jump as deep as an element turns it inside out
    path = np.array([[0, 0, LAYER + BALL], [0, 0, LAYER + BALL - depth]])
    scene = build.scene(
        body.geometry,
        build.Tissue(ReducedPolynomial(order=1), Quadratic(), dict(C10=MU / 2), dict(K=K), 1000.0),
        np.arange(2.0),
        build.ProbePath(np.arange(2.0), path, BALL),
        held=body.held,
    )
    scene = scene.put({"probe.penalty": scene.probe.penalty * penalty, "probe.mass": scene.probe.mass * penalty})
    for k in range(1, steps + 1):
        found = statics.checked(statics.compiled(scene, k / steps, tolerance=1e-6, margin=4.0))
        scene = scene.put({"body.settled": found.displacement})
    return 4 * float(found.force[2])


@pytest.mark.parametrize("depth", [pytest.param(5e-4, marks=pytest.mark.slow), 1e-3])
def test_a_small_depth_is_hertz_with_the_bonded_layer(depth):
    """A ball of 20 mm, 0.5 and 1 mm deep (contact radii 3.2 and 4.5 mm); facets of 0.63 mm."""
    assert pressed(depth, (16, 12)) == pytest.approx(bonded(depth), rel=0.02)


@pytest.mark.slow
def test_the_penalty_hardly_matters():
    """Half and twice the automatic penalty move the force by less than the mesh does (2 % at this depth)."""
    half, one, two = (pressed(1e-3, (12, 8), factor) for factor in (0.5, 1.0, 2.0))
    assert half < one < two
    assert two / one - 1 < 0.01
    assert 1 - half / one < 0.015

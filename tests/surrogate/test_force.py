"""The force of a surrogate: from one energy, equal to formulas, passive, differentiable; numpy and JAX agree."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from tests.surrogate import made
from tissuejax.surrogate import drag
from tissuejax.surrogate.cardinal import design, from_depths, through
from tissuejax.surrogate.live.ask import Asker

elastic = eqx.filter_jit(lambda s, p: s.elastic(p))


def asked(s, t, path):
    """The force along a path, asked tick by tick on the host (shown below to be the same as JAX's)."""
    asker = Asker(s)
    return np.array([asker.tick(p, dt) for p, dt in zip(path, np.diff(t, prepend=t[0]))])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_a_spline_goes_through_its_values_and_keeps_cubics(n):
    t = np.arange(n, dtype=float)
    p = np.poly1d([0.3, -1.0, 2.0, 0.5][-n:])  # the highest degree that n values can tell
    assert np.allclose(design(t, max(n - 1, 1)) @ through(n) @ p(t), p(t))
    if n > 1:
        fine = np.linspace(0, n - 1, 50)
        assert np.allclose(design(fine, n - 1) @ through(n) @ p(t), p(fine))


def test_from_depths_tells_nothing_at_contact_and_keeps_cubics():
    p, s = np.poly1d([1.0, -2.0, 0.3, 4.0]), np.arange(1, 9.0)
    fine = np.linspace(0, 8, 40)
    assert np.allclose(design(fine, 8) @ from_depths(8) @ p(s), p(fine))


def test_force_is_that_of_the_formula_and_lateral_its_energys_slope():
    s = made.formula()
    rng = np.random.default_rng(1)
    for x, y, share in rng.uniform([-0.009, -0.007, 0.2], [0.009, 0.007, 1.0], (12, 3)):
        d = share * made.DEPTH
        force = np.asarray(elastic(s, made.at(x, y, d)))
        up = made.vertical(x, y, d)
        slope = made.work(0, 0, d) * np.array([made.LEAN, 2 * made.LEAN**2 * y])
        tilt = np.array([0.05 - x, -2 * y])
        assert force[2] == pytest.approx(up, rel=2e-4)
        assert force[:2] == pytest.approx(-slope - up * tilt, abs=1e-3 * up)


def test_closed_loops_do_no_work_elastic_and_lose_when_it_relaxes_or_rubs():
    angle = np.linspace(0, 2 * np.pi, 4001)
    x, y, d = (
        0.006 * np.sin(angle),
        0.005 * np.sin(2 * angle),
        0.003 * (1 - 1.4 * np.cos(angle)),
    )  # in and out of contact
    path = np.stack([x, y, made.height(x, y) - d], 1)
    time = np.linspace(0, 4, len(path))
    press = made.work(0.0, 0.0, d.max())

    def lost(s):
        force = asked(s, time, path)
        mean = (force[1:] + force[:-1]) / 2
        return -np.sum(mean * np.diff(path, axis=0)) / press

    assert abs(lost(made.formula())) < 1e-4
    assert lost(made.formula(friction=0.2)) > 0.01
    assert lost(made.formula(g=(0.3,), tau=(0.5,))) > 0.01


def test_above_beside_and_below_the_box():
    s = made.formula()
    assert not np.any(elastic(s, made.at(0.0, 0.0, -1e-3)))
    assert not Asker(s).tick(made.at(0.012, 0.0, 3e-3), 1e-3).any()  # more than a millimetre beside
    deepest = made.vertical(0.0, 0.0, made.DEPTH)
    assert float(elastic(s, made.at(0.0, 0.0, made.DEPTH + 2e-3))[2]) == pytest.approx(deepest, rel=1e-3)


def test_over_the_side_the_force_fades_without_a_kick_and_returns_after_a_lift():
    """Out over the side at depth, back in, out of contact and down again: nothing pushes outwards, no work is won."""
    for s in (made.formula(), made.formula(g=(0.3,), tau=(0.5,), friction=0.2, strength=100.0)):
        t = np.linspace(0, 8, 8001)
        knots = [0, 1, 2, 3, 4, 5, 6, 7, 8]
        x = np.interp(t, knots, [0.009, 0.009, 0.0125, 0.009, 0.009, 0.009, 0.009, 0.0125, 0.0125])
        d = np.interp(t, knots, [-1e-3, 3e-3, 3e-3, 3e-3, -3e-3, 3e-3, 3e-3, 3e-3, -3e-3])
        path = np.stack([x, 0 * x, made.height(np.minimum(x, 0.01), 0.0) - d], 1)
        force = asked(s, t, path)
        inside = np.linalg.norm(force[900:1100, :2], axis=1).max()
        assert np.linalg.norm(force[:, :2], axis=1).max() < 1.5 * inside + 0.05 * force[:, 2].max()
        assert not force[(t > 2) & (t < 4)].any()  # gone until it was lifted
        assert force[4900:5900, 2].max() > 0.5 * made.vertical(0.009, 0.0, 3e-3)
        mean = (force[1:] + force[:-1]) / 2
        given = -np.cumsum(np.sum(mean * np.diff(path, axis=0), axis=1))  # by the hand
        assert given.min() > -1e-3 * made.work(0.009, 0.0, 3e-3)
        assert given[-1] > 0.9 * made.work(0.009, 0.0, 3e-3)


def test_lifted_tissue_does_not_pull():
    s = made.formula(g=(0.5,), tau=(0.3,))
    d = np.interp(np.linspace(0, 3, 600), [0, 1, 2, 2.1, 3], [-1e-3, 5e-3, 5e-3, -1e-3, -1e-3])
    path = np.stack([0 * d, 0 * d, made.height(0.0, 0.0) - d], 1)
    force = asked(s, np.linspace(0, 3, 600), path)
    assert force[:, 2].min() >= 0
    assert force[250:380, 2].min() > 0.02
    assert not force[d < 0].any()


def test_numpy_asks_the_same_as_jax_with_everything_on():
    s = made.formula(g=(0.2, 0.1), tau=(0.4, 4.0), friction=0.3, strength=150.0)
    t = np.linspace(0, 3, 301)
    d = np.interp(t, [0, 1, 2, 2.6, 3], [-1e-3, 4e-3, 0.0065, -5e-4, -2e-3])  # beyond the floor and a side
    x = np.interp(t, [0, 1.2, 2.0, 2.2, 3], [-0.004, -0.004, 0.0104, 0.0098, 0.0104])  # a little out, and back
    path = np.stack([x, 0.3 * x, made.height(x, 0.3 * x) - d], 1)
    wanted = np.asarray(eqx.filter_jit(lambda s, t, p: s.respond(t, p))(s, jnp.asarray(t), jnp.asarray(path)))
    got = asked(s, t, path)
    assert abs(wanted).max() > 0.1
    assert np.allclose(got, wanted, atol=1e-10)


def test_adhesion_pulls_on_the_way_out_only_and_ends():
    s = made.formula(strength=300.0)
    d = np.concatenate([np.linspace(-2e-4, 2e-3, 200), np.linspace(2e-3, -2e-3, 400)])
    path = np.stack([0 * d, 0 * d, made.height(0.0, 0.0) - d], 1)
    force = asked(s, np.linspace(0, 2, 600), path)[:, 2]
    plain = asked(made.formula(), np.linspace(0, 2, 600), path)[:, 2]
    assert np.allclose(force[:200], plain[:200])
    least = -2 * np.pi * made.RADIUS * 300.0 * 2e-4 * np.e
    assert least < force.min() < 0.5 * least
    assert not force[d < -5.5 * 2e-4].any()


@pytest.mark.parametrize("share", [0.75001, 0.8, 0.875, 0.95, 0.99999])
def test_the_neck_of_soft_tissue_takes_its_share_of_the_pull(share):
    """The modulus is chosen for the share by the formula solved the other way round; Python, JAX and limits agree."""
    power = (1 - 8 * (share - 7 / 8)) / (1 + 8 * (share - 7 / 8))  # 4.04 l^1.4
    lam, sigma, work = (power / 4.04) ** (1 / 1.4), 300.0, np.e * 300.0 * 2e-4
    modulus = 0.75 * np.sqrt(made.RADIUS / (np.pi * work * (lam / (2 * sigma)) ** 3))
    d = np.concatenate([np.linspace(-2e-4, 2e-3, 200), np.linspace(2e-3, -2e-3, 400)])
    path = np.stack([0 * d, 0 * d, made.height(0.0, 0.0) - d], 1)
    t, soft = np.linspace(0, 2, 600), made.formula(strength=sigma, modulus=modulus)
    plain, rigid = (asked(s, t, path)[:, 2] for s in (made.formula(), made.formula(strength=sigma)))
    got = asked(soft, t, path)
    assert got[:, 2] - plain == pytest.approx(share * (rigid - plain), abs=1e-9)
    theirs = eqx.filter_jit(lambda s, t, p: s.respond(t, p))(soft, jnp.asarray(t), jnp.asarray(path))
    assert np.allclose(got, theirs, atol=1e-10)


def maugis(lam: float) -> float:
    """Pull-off force over pi w R by Maugis's own equations (1992, 6.17 and its load): a ring of constant stress around
    the contact, solved for its width at each radius of contact."""

    def load(a):
        def opening(m):
            mu = np.sqrt(m * m - 1)
            t = np.arctan(mu)
            return lam * a * a / 2 * (mu + (m * m - 2) * t) + 4 / 3 * lam * lam * a * (mu * t - m + 1) - 1

        m = brentq(opening, 1.0, 1e6)
        mu = np.sqrt(m * m - 1)
        return a**3 - lam * a * a * (mu + m * m * np.arctan(mu))

    return -minimize_scalar(load, bounds=(0.02, 2.0), method="bounded").fun


def test_the_share_of_the_neck_is_that_of_maugis():
    """The fitted formula beside the equations it was fitted to, over four decades of stiffness; the limits are those of
    a rigid surface, 2 pi w R, and of Johnson, Kendall and Roberts, 1.5 pi w R."""
    sigma, reach = 300.0, 2e-4
    work, apart = np.e * sigma * reach, []
    for modulus in np.geomspace(1e2, 1e6, 17):
        lam = 2 * sigma * np.cbrt(made.RADIUS / (np.pi * work * (4 / 3 * modulus) ** 2))
        s = made.formula(strength=sigma, modulus=modulus)
        apart.append(2 * float(drag.neck(s.rub, s.radius, s.factor)) / maugis(lam) - 1)
    assert np.abs(apart).max() < 0.017
    for modulus, share in ((1e-3, 0.75), (1e12, 1.0)):
        s = made.formula(strength=sigma, modulus=modulus)
        assert float(drag.neck(s.rub, s.radius, s.factor)) == pytest.approx(share, abs=1e-4)


def test_friction_reaches_the_coulomb_limit_and_turns_with_the_motion():
    s = made.formula(friction=0.3)
    t = np.linspace(0, 4, 801)
    x = np.interp(t, [0, 1, 2, 3, 4], [0, 0, 0.006, 0.0, 0.0])
    d = np.interp(t, [0, 1, 4], [-1e-3, 3e-3, 3e-3])
    path = np.stack([x, 0 * x, made.height(x, 0.0) - d], 1)
    rubbed = asked(s, t, path) - asked(made.formula(), t, path)
    normal = asked(made.formula(), t, path)[:, 2]
    more = 1 + 0.5 * 0.2 + 0.25 * 0.1 + 0.125 * 0.15  # made.SLIP at half the depth of the tables
    assert rubbed[395, 0] == pytest.approx(-0.3 * more * normal[395], rel=1e-6)
    assert rubbed[595, 0] == pytest.approx(0.3 * more * normal[595], rel=1e-6)


def test_derivatives_by_path_and_by_leaves():
    s = made.formula(g=(0.2,), tau=(0.5,))
    t = jnp.linspace(0, 1, 40)
    d = jnp.linspace(-1e-3, 4e-3, 40)
    path = jnp.stack([0 * d + 0.002, 0 * d, made.height(0.002, 0.0) - d], 1)

    def last(theta):
        return s.put({"memory.g": theta[1:]}).respond(t, path - jnp.array([0, 0, 1.0]) * theta[0])[-1, 2]

    @jax.jit
    def slope(at, along):
        return jax.jvp(last, (at,), (along,))

    at, h = np.array([0.0, 0.2]), 1e-6
    for along in np.eye(2):
        wanted = (float(slope(at + h * along, along)[0]) - float(slope(at - h * along, along)[0])) / (2 * h)
        assert float(slope(at, along)[1]) == pytest.approx(wanted, rel=1e-4)


def test_a_fit_through_a_surrogate_finds_stiffness_and_relaxation_again():
    """A cheap first model: twenty Gauss-Newton steps at most on a recording that another stiffness and share made."""
    s, truth = made.formula(g=(0.2,), tau=(0.5,)), np.array([1.3, 0.35])
    t = np.linspace(0, 3, 200)
    d = np.interp(t, [0, 0.5, 2, 3], [-1e-3, 4e-3, 4e-3, -1e-3])
    path = np.stack([0 * t + 0.002, 0 * t, made.height(0.002, 0.0) - d], 1)
    noise = 1e-3 * np.random.default_rng(1).normal(size=(200, 3))

    def force_of(theta):
        return s.put({"factor": theta[0], "memory.g": theta[1:]}).respond(jnp.asarray(t), jnp.asarray(path))

    measured = np.asarray(force_of(truth)) + noise
    residual = jax.jit(lambda theta: (force_of(theta) - measured).ravel())
    tangents, theta = jax.jit(jax.jacfwd(residual)), np.array([1.0, 0.1])
    for _ in range(20):
        J = np.asarray(tangents(theta))
        step = np.linalg.lstsq(J, -np.asarray(residual(theta)), rcond=None)[0]
        theta = theta + step
        if np.abs(step).max() < 1e-9:
            break
    std = 1e-3 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert np.abs(step).max() < 1e-9
    assert (np.abs(theta - truth) < 3 * std).all()
    assert (std < 0.05).all()

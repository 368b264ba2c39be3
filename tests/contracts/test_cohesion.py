"""Every cohesive law keeps the same promises: area, irreversibility, energy, derivative, neutral value."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.cohesion.catalogue import law, laws
from tissuejax.cohesion.engine import pull, stored, whole
from tissuejax.cohesion.mixity import mixed

TAU, G, K = 4000.0, 2.0, jnp.asarray(1e8)
NAMES = sorted(laws())
NORMAL = tuple(jnp.asarray([x]) for x in (0.0, 1.0, 0.0))


def values(name):
    return {"strength": jnp.asarray(TAU), "energy": jnp.asarray(G)} | (
        {"shape": jnp.asarray(0.5)} if law(name).shaped else {}
    )


def walk(name, across, along=None, p=None):
    """Opens a point step by step; traction across, secants, energies lost."""
    p = values(name) if p is None else p
    along = np.zeros_like(across) if along is None else along

    def step(memory, gap):
        held = pull(law(name), p, K, K, tuple(jnp.full((1, 1), g) for g in gap), NORMAL, memory)
        tractions = jnp.stack([t[0, 0] for t in held.traction])
        return held.memory, (tractions, held.memory.secant[0, 0], held.lost[0, 0])

    gaps = jnp.stack([jnp.asarray(along), jnp.asarray(across), jnp.zeros(len(across))], 1)
    return jax.lax.scan(step, whole(law(name), p, K, jnp.zeros((1, 1))), gaps)[1]


# Points of the curves by hand, tau 4 kPa, G 2 J/m^2, K 1e8 Pa/m.
POINTS = {
    "bilinear": {0.02: 2000.0, 0.04: 4000.0, 0.2: 3333.33, 0.5: 2083.33, 0.9: 416.67, 1.0: 0.0},
    "trapezoidal": {0.02: 2000.0, 0.2: 4000.0, 0.5: 2230.77, 0.7: 0.0},
    "exponential": {0.5: 1950.36, 2 / (np.e * 4): 4000.0},
}


@pytest.mark.parametrize("name", NAMES)
def test_points_of_the_curve(name):
    assert name in POINTS, f"no points by hand for {name}: add them"
    for opening, traction in POINTS[name].items():
        d = jnp.asarray(1e-3 * opening)
        assert float(law(name).secant(values(name), K, d) * d) == pytest.approx(traction, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_area_under_the_curve_is_the_energy(name):
    d = np.linspace(0, 4e-3, 400001)
    traction = np.asarray(law(name).secant(values(name), K, jnp.asarray(d))) * d
    area = np.concatenate([[0], np.cumsum(0.5 * (traction[1:] + traction[:-1]) * np.diff(d))])
    np.testing.assert_allclose(law(name).work(values(name), K, jnp.asarray(d)), area, atol=1e-6 * G)
    assert area[-1] == pytest.approx(G, rel=1e-5)
    end = float(law(name).end(values(name), K))
    assert np.interp(end, d, area) >= 0.9899 * G
    assert traction.max() == pytest.approx(TAU, rel=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_unloading_goes_to_the_origin_and_nothing_heals(name):
    across = 1e-3 * np.concatenate([np.linspace(0, 0.5, 101), np.linspace(0.5, 0, 51)[1:], np.linspace(0, 0.5, 51)[1:]])
    traction, secant, lost = (np.asarray(x) for x in walk(name, across))
    down, up = -traction[101:151, 1], -traction[151:, 1]
    np.testing.assert_allclose(down, secant[100] * across[101:151], rtol=1e-12)
    np.testing.assert_allclose(up[::-1][1:], down[:-1], rtol=1e-12)
    assert (np.diff(secant) <= 0).all()
    assert (lost >= 0).all()
    assert lost[101:].sum() == 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", [0.0, 0.7, 1.4])
def test_lost_and_stored_are_the_work_done(name, mode):
    p = values(name) | {"shear_strength": jnp.asarray(2.0), "shear_energy": jnp.asarray(3.0)}
    d = 1e-3 * np.concatenate([np.linspace(0, 0.6, 3001), np.linspace(0.6, 0.1, 501)[1:]])
    traction, secant, lost = (np.asarray(x) for x in walk(name, d * np.cos(mode), d * np.sin(mode), p))
    along = -(traction[:, 1] * np.cos(mode) + traction[:, 0] * np.sin(mode))
    work = np.sum(0.5 * (along[1:] + along[:-1]) * np.diff(d))
    gap = tuple(jnp.asarray(x) for x in (d[-1] * np.sin(mode), d[-1] * np.cos(mode), 0.0))
    held = stored(secant[-1], K, gap, tuple(x[0] for x in NORMAL))
    assert lost.sum() + float(held) == pytest.approx(work, rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_a_path_that_turns_from_opening_to_sliding_keeps_its_balance(name):
    p = values(name) | {"shear_strength": jnp.asarray(1.5), "shear_energy": jnp.asarray(2.0)}
    s = np.linspace(0, 1, 20001)
    across, along = 3e-4 * np.sin(np.pi * s / 2), 5e-4 * s**2
    traction, secant, lost = (np.asarray(x) for x in walk(name, across, along, p))
    mean = -0.5 * (traction[1:] + traction[:-1])
    work = np.sum(mean[:, 1] * np.diff(across) + mean[:, 0] * np.diff(along))
    gap = tuple(jnp.asarray(x) for x in (along[-1], across[-1], 0.0))
    assert lost.sum() + float(stored(secant[-1], K, gap, tuple(x[0] for x in NORMAL))) == pytest.approx(work, rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", ["strength", "energy"])
def test_derivative(name, what):
    d = jnp.asarray([1e-5, 1e-4, 3e-4, 6e-4])

    def traction(x):
        return law(name).secant(values(name) | {what: x}, K, d) * d

    x = values(name)[what]
    step = 1e-6 * x
    central = (traction(x + step) - traction(x - step)) / (2 * step)
    np.testing.assert_allclose(jax.jacfwd(traction)(x), central, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_infinite_energy_is_an_elastic_layer(name):
    across = np.linspace(0, 5e-3, 11)
    traction, secant, lost = walk(name, across, p=values(name) | {"energy": jnp.asarray(jnp.inf)})
    np.testing.assert_array_equal(secant, float(K))
    np.testing.assert_allclose(-traction[:, 1], float(K) * across, rtol=1e-14)
    assert float(lost.sum()) == 0


def test_closing_is_held_after_parting():
    traction, secant, _ = walk("bilinear", np.array([0, 2e-3, -1e-5]))
    assert float(secant[1]) == 0
    assert float(traction[-1, 1]) == pytest.approx(1e8 * 1e-5)  # pushes the plus side out


def test_loss_by_hand():
    """Half open, back to a quarter: 1041.67 Pa, 0.95833 J/m^2 gone (bilinear, algebra)."""
    across = 1e-3 * np.concatenate([np.linspace(0, 0.5, 5001), np.linspace(0.5, 0.25, 11)])
    traction, _, lost = walk("bilinear", across)
    assert -float(traction[-1, 1]) == pytest.approx(1041.67, rel=1e-5)
    assert float(lost.sum()) == pytest.approx(0.95833, rel=1e-4)


def test_mixed_mode_by_hand():
    p = {"strength": 1.0, "energy": 2.0, "shear_energy": 3.0, "shear_strength": 2.0, "exponent": 1.5}
    half = mixed(p, jnp.asarray(0.5))
    assert float(half.energy) == pytest.approx(3.41421, rel=1e-5)
    # (t/1)^2/2 + (t/2)^2/2 = 1 along the diagonal
    assert float(half.strength) == pytest.approx((0.5 + 0.125) ** -0.5)
    assert float(mixed(p, jnp.asarray(0.0)).energy) == 2.0

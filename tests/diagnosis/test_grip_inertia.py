"""A mass that moves with the crosshead, below the load cell: Newton's second law, with accelerations in closed form."""

import jax.numpy as jnp
import numpy as np
import pytest

import tissuejax as tj
from tissuejax.effects.history import acceleration
from tissuejax.recordings.recording import Channel, Recording, Sample

MASS, HEIGHT, AREA, SPEED = 1.5, 0.04, 1e-4, 0.02  # kg, m, m^2, m/s


def moved(time: np.ndarray, corners: list[tuple[float, float]], turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Way and acceleration of a crosshead whose speed changes along half a cosine: at each corner (time, speed after)
    for `turn`, s."""
    way, speed_change, before = np.zeros_like(time), np.zeros_like(time), 0.0
    for at, after in corners:
        s = np.clip((time - at) / turn, 0.0, 1.0)
        # the integral of (1 - cos(pi s))/2 over time, which goes on as t - at - turn / 2
        way += (after - before) * (0.5 * turn * (s - np.sin(np.pi * s) / np.pi) + np.maximum(time - at - turn, 0.0))
        speed_change += (after - before) * np.where((s > 0) & (s < 1), 0.5 * np.pi / turn * np.sin(np.pi * s), 0.0)
        before = after
    return way, speed_change


def cycled(mass: float, turn: float, noise: float) -> Sample:
    """Three neo-Hookean strips of 4 cm, pulled to and fro at 20 mm/s or half of it, sampled every 15 ms.

    Args:
        turn: s that a start or a turn takes; noise: N, where forces reach 4.
    """
    rng, recordings = np.random.default_rng(11), {}
    for k, (speed, leg) in enumerate([(SPEED, 0.6), (0.5 * SPEED, 1.0), (SPEED, 0.45)]):
        time = np.arange(0.0, 4 * leg + 0.25, 0.015)
        corners = [(0.1 + i * leg, speed * (-1) ** i) for i in range(4)] + [(0.1 + 4 * leg, 0.0)]
        way, a = moved(time, corners, turn)
        stretch = 1 + way / HEIGHT
        force = AREA * 60e3 * (stretch - stretch**-2) + mass * a + rng.normal(0, noise, len(time))
        channel = Channel(time, force / AREA, "Pa", noise / AREA)
        told = {"area": AREA, "height": HEIGHT}
        inputs = {"time": time, "stretch": stretch}
        recordings[f"s{k}"] = Recording(f"s{k}", "uniaxial", inputs, {"nominal_stress": channel}, told)
    return Sample("cycled", recordings)


def test_the_acceleration_of_a_parabola_is_its_own_however_it_is_sampled(rng):
    time = np.cumsum(rng.uniform(0.01, 0.1, 40))
    x = np.stack([1 + 3 * time + 2.5 * time**2, 4 - time**2], axis=1)
    a = np.asarray(acceleration(jnp.asarray(time), jnp.asarray(x)))
    assert a[1:-1] == pytest.approx(np.broadcast_to([5.0, -2.0], (38, 2)), rel=1e-8)
    assert np.all(a[[0, -1]] == 0.0)


def test_repeated_times_have_none():
    time = jnp.array([0.0, 1.0, 2.0, 2.0, 2.0])
    assert np.array_equal(acceleration(time, jnp.array([0.0, 1.0, 4.0, 4.0, 4.0])), [0.0, 2.0, 0.0, 0.0, 0.0])


# What moves or lags with the crosshead, and what relaxes behind it.
FEW = ("grip-inertia", "clock-lag", "viscoelasticity", "load-cell-bend", "drift")


@pytest.mark.parametrize(
    ("turn", "noise", "tried"),
    [
        pytest.param(0.08, 0.05, FEW, marks=pytest.mark.slow),
        pytest.param(0.08, 0.05, None, marks=pytest.mark.slow),
        pytest.param(0.03, 0.005, None, marks=pytest.mark.slow),
    ],
    ids=["five of few", "five", "two"],
)
def test_a_mass_below_the_load_cell_is_found_alone(turn, noise, tried):
    """Also where a turn is over within two samples and noise is an eighth of a per cent of the peak: what samples don't
    tell of it is no second effect."""
    found = tj.diagnose(cycled(MASS, turn, noise), "neo-hookean", effects=tried).as_dict()
    assert [e["name"] for e in found["effects"]] == ["grip-inertia"]
    told = found["effects"][0]["parameters"]["effects.grip-inertia.mass"]
    assert abs(told["value"] - MASS) <= max(2 * told["std"], 0.05 * MASS)  # a parabola cuts a twentieth off the peaks


@pytest.mark.parametrize("tried", [FEW, pytest.param(None, marks=pytest.mark.slow)], ids=["few", "all"])
def test_none_is_found_where_there_is_none(tried):
    assert not tj.diagnose(cycled(0.0, 0.08, 0.05), "neo-hookean", effects=tried).as_dict()["effects"]

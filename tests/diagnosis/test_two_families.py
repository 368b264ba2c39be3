"""Two unlike families of fibres, where one family alone comes to rest along an axis of the tests."""

import copy

import numpy as np
import pytest
from scipy.optimize import brentq

from tissuejax.diagnosis.judgement.answer import answer
from tissuejax.diagnosis.judgement.blocks import blocks, series
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.diagnosis.material import MaterialBench, strain_states
from tissuejax.energies.catalogue import energy
from tissuejax.estimation.discrepancy import discrepancy
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, STIFF, NOISE = 1800.0, 1500.0, 10.0
FAMILIES = np.radians([110.0, 170.0])
X, Y, Z = np.eye(3)


def slopes(x: float, y: float) -> tuple[float, float]:
    """dpsi/dx and dpsi/dy of stretches along x and y, z = 1/(xy): neo-Hookean, and fibres k/2 (I4 - 1)^2 in pull."""
    one, two = MU * (x - x**-3 * y**-2), MU * (y - y**-3 * x**-2)
    for c, s in zip(np.cos(FAMILIES) ** 2, np.sin(FAMILIES) ** 2):
        pull = 2 * STIFF / 2 * max(c * x * x + s * y * y - 1, 0.0)
        one, two = one + pull * c * x, two + pull * s * y
    return one, two


def along_x(stretch: float) -> float:
    """Nominal stress with free faces y and z."""
    return slopes(stretch, brentq(lambda y: slopes(stretch, y)[1], 0.3, 3.0, xtol=1e-14))[0]


def along_z(stretch: float) -> float:
    """The same of a specimen loaded along z: dpsi/dz at the x of least energy, y = 1/(xz)."""

    def downhill(x: float) -> float:
        one, two = slopes(x, 1 / (x * stretch))
        return one - two / (x * x * stretch)

    x = brentq(downhill, 0.3, 3.0, xtol=1e-14)
    return -slopes(x, 1 / (x * stretch))[1] / (x * stretch**2)


@pytest.fixture(scope="module")
def bench() -> MaterialBench:
    rng = np.random.default_rng(3)
    up = np.interp(np.linspace(0, 1, 150), [0.1, 0.6, 1.0], [0.0, 1.0, 0.0])
    both = np.stack([1 + 0.25 * up, 1 + 0.13 * up], -1)  # along y, and along x
    made = {
        "r1": ("uniaxial", X, 1 + 0.4 * up, [along_x(l) for l in 1 + 0.4 * up]),
        "r2": ("uniaxial", Z, 1 - 0.25 * up, [along_z(l) for l in 1 - 0.25 * up]),
        "r3": ("biaxial", Y, both, [slopes(x, y)[::-1] for y, x in both]),
        "r4": ("uniaxial", X, 1.05 - 0.25 + 0.6 * up, [along_x(l) for l in 1.05 - 0.25 + 0.6 * up]),
    }
    recordings, time = {}, np.linspace(0.0, 12.0, 150)
    for name, (kind, direction, stretch, stress) in made.items():
        noisy = np.array(stress) + NOISE * rng.standard_normal(np.shape(stress))
        channel = Channel(time, noisy, "Pa", NOISE)
        inputs, told = {"time": time, "stretch": stretch}, {"direction": direction}
        recordings[name] = Recording(name, kind, inputs, {"nominal_stress": channel}, told)
    sigma = dict.fromkeys(made, NOISE)
    return MaterialBench.of(
        Sample("s", recordings), energy("neo-hookean"), ("r1", "r2", "r3"), ("r4",), sigma, ["anisotropy"]
    )


@pytest.mark.slow
def test_two_unlike_families_are_found_from_off_the_axis(bench):
    """The tests, all along axes, can't tell an angle from its mirror image: 110 and 170 degrees from 70 and 10."""
    whole = copy.copy(bench)
    whole.fitted, whole.held_out = (*bench.fitted, *bench.held_out), ()
    cut = blocks(whole)
    of = discrepancy(series(whole, cut, strain_states(whole)), cut.spread(whole.sigma))
    verdict = answer(bench, whole, cut, of, Setup(effort=Effort(most=1)))
    assert verdict.judgement.names == ("anisotropy",)
    values = verdict.chosen.values
    angle, spread = (values[f"effects.anisotropy.{name}"] for name in ("angle", "spread"))
    found = np.sort(np.degrees(np.arccos(np.abs(np.cos([angle + spread, angle - spread])))))
    np.testing.assert_allclose(found, [10.0, 70.0], atol=5.0)

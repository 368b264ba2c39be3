"""Faults of a probe's force, put into it by other code than the catalogue's, are named from end to end."""

import numpy as np
import pytest

from tests.probing.bench import VALUES, measured, recording, sample
from tissuejax.challenge.rests.play import play
from tissuejax.diagnosis.judgement.answer import Answered, answer
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.diagnosis.kinds.probings import PROBING
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_discrepancy import probing_discrepancy
from tissuejax.diagnosis.probing_offered import pressed
from tissuejax.diagnosis.probing_view import ProbingView, probing_blocks
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.recording import Channel, Recording, Sample

SETTINGS = {"mesh": "file", "compression": 3.0, "interval": 0.04, "step": 8e-4, "processes": 1}
TWO = sample(recording("a"), recording("b", place=(-0.004, 0.004), depth=2.5e-3))
RIVALS = ("contact-offset", "force-drift")
LAW = energy("reduced-polynomial-2")
FREQUENCY, HUM = 2.2, 0.02  # Hz, N: six times the noise, a tenth of the press


def humming(r: Recording, force: np.ndarray) -> np.ndarray:
    """With a tenth of its third harmonic: wires pick up no pure sine. A tenth of it along x."""
    a = 2 * np.pi * FREQUENCY * np.asarray(r.channels["force"].time) + (0.4 if r.name == "a" else 2.0)
    return force + HUM * (np.sin(a) + 0.1 * np.sin(3 * a))[:, None] * [0.1, 0.0, 1.0]


def scattered(r: Recording, force: np.ndarray) -> np.ndarray:
    """The second site is half as stiff again. Two sites are one difference: that of a fifth is told with 0.37 only."""
    return force * (1.5 if r.name == "b" else 1.0)


def looping(r: Recording, force: np.ndarray) -> np.ndarray:
    """A share of the force that lags behind the way by plays of two gaps."""
    depth = -np.interp(r.channels["force"].time, r.inputs["probe/time"], r.inputs["probe/position"][:, 2])
    span = float(np.ptp(depth))
    depth = depth - depth[0]
    lag = sum((depth - play(depth, g * span)) / (g * span) for g in (0.05, 0.2)) / 2
    return force * (1 + 0.15 * lag)[:, None]


@pytest.fixture(scope="module")
def simulated() -> dict[str, Recording]:
    """What a slower simulation, and so another one than is fitted, says of two presses."""
    fine = ProbingBench.of(TWO, LAW, ("a", "b"), (), RIVALS, **SETTINGS | {"compression": 1.5})
    return fine.runs._predictor("fine", ()).predict(VALUES)


def diagnosed(simulated, fault, tried) -> Answered:
    """The answer to the presses with a fault and noise in their force."""
    rng, made = np.random.default_rng(7), {}
    for name, r in TWO.recordings.items():
        told = simulated[name]
        seen = told.channels["force"]
        force = Channel(seen.time, fault(r, np.asarray(seen.values, float)), seen.unit, seen.noise_std)
        faulty = Recording(name, r.experiment, r.inputs, {**told.channels, "force": force}, r.attributes)
        made[name] = measured(faulty, r, rng)
    whole = Sample(TWO.name, made, geometry=TWO.geometry, density=TWO.density)
    own = ProbingBench.of(whole, LAW, ("a", "b"), (), (*RIVALS, *tried), **SETTINGS)
    shown = own.narrowed(("a",), ("b",), (*RIVALS, *tried))
    for bench in (own, shown):
        bench.candidates, left_out = pressed(own.segments, bench.candidates)
        assert not left_out
    view = ProbingView.of(own)
    cut = probing_blocks(view)
    found = answer(ProbingView.of(shown), view, cut, probing_discrepancy(view, cut), Setup(effort=PROBING))
    found.simulations = own.runs.count
    return found


FAULTS = {"force-hum": humming, "specimen-scatter": scattered, "hysteresis": looping}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_the_force_is_named(simulated, name):
    found = diagnosed(simulated, FAULTS[name], tuple(FAULTS))
    assert found.judgement.names == (name,)
    assert found.simulations < 400
    if name == "force-hum":
        values, std = found.chosen.values, found.chosen.std
        path = "effects.force-hum.frequency"
        assert abs(values[path] - FREQUENCY) < 4 * std[path]
        size = np.hypot(*(values[f"effects.force-hum.{part}.a"] for part in ("sin", "cos")))
        assert size == pytest.approx(HUM, rel=0.1)

"""What a protocol can't show is not offered as an answer, and the reader is told."""

from dataclasses import replace

import numpy as np
import pytest

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.offered import Protocol, offered
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.recordings.specimens import NO_TIME

TIME = np.linspace(0, 20, 200)
RAMP = 1 + 0.015 * TIME
HOLD = np.interp(TIME, [0, 5, 20], [1, 1.3, 1.3])
CYCLE = np.interp(TIME, [0, 10, 20], [1, 1.3, 1.0])
NAMES = ("viscoelasticity", "softening", "permanent-set", "aging", "anisotropy", "compressibility", "slack")
CANDIDATES = {n: Candidate(n, (f"effects.{n}.x",)) for n in NAMES}


def sample(*stretches, kind="uniaxial", **attributes):
    made = {}
    for i, stretch in enumerate(stretches):
        told = {k: v[i] for k, v in attributes.items()}
        channel = Channel(TIME, 1000 * (stretch - stretch**-2), "Pa", 1.0)
        made[f"r{i}"] = Recording(f"r{i}", kind, {"time": TIME, "stretch": stretch}, {"nominal_stress": channel}, told)
    return Sample("s", made)


def names(*stretches, **more):
    kept, _ = offered(sample(*stretches, **more), CANDIDATES)
    return {c.name for c in kept.values()}


@pytest.mark.parametrize(
    ("stretch", "seen"),
    [
        (RAMP, set()),
        (HOLD, {"viscoelasticity"}),
        (CYCLE, {"viscoelasticity", "softening", "permanent-set", "hysteresis"}),
    ],
)
def test_memory_needs_a_hold_or_a_way_back(stretch, seen):
    assert names(stretch) & {"viscoelasticity", "softening", "permanent-set", "hysteresis"} == seen


def test_noise_on_the_stretch_is_no_unloading():
    rng = np.random.default_rng(0)
    assert not Protocol.of(sample(RAMP + 1e-4 * rng.standard_normal(len(RAMP)))).reversed


def test_two_rates_show_relaxation_without_a_hold():
    assert "viscoelasticity" in names(RAMP, 1 + 0.25 * (RAMP - 1))
    assert "viscoelasticity" not in names(RAMP, RAMP)


def test_aging_needs_times_and_fibres_need_directions():
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    assert not names(CYCLE, CYCLE, start=(0.0, 0.0), direction=(x, x)) & {"aging", "anisotropy"}
    assert {"aging", "anisotropy"} <= names(CYCLE, CYCLE, start=(0.0, 300.0), direction=(x, y))


def test_a_change_of_volume_needs_tests_of_unlike_constraint():
    assert "compressibility" not in names(CYCLE)
    assert "compressibility" in names(CYCLE, kind="planar")


def test_specimens_can_differ_only_where_there_are_several_recordings():
    assert "specimen-scatter" not in names(CYCLE)
    assert "specimen-scatter" in names(CYCLE, CYCLE)
    untimed = replace(sample(CYCLE, CYCLE), notes=NO_TIME)
    assert "specimen-scatter" in offered(untimed, CANDIDATES)[0]


def test_what_was_left_out_is_said_with_its_reason():
    _, said = offered(sample(RAMP), CANDIDATES)
    assert any("softening" in s and "nothing is unloaded" in s for s in said)
    assert any("aging" in s and "start" in s for s in said)

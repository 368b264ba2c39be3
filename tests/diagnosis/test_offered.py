"""What a protocol can't show is not offered as an answer, and the reader is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.catalogue import entries
from tissuejax.diagnosis.offered import LACKING, Protocol, offered, paced
from tissuejax.effects.catalogue import effects, needs
from tissuejax.effects.form import Sizes
from tissuejax.energies.catalogue import energy
from tissuejax.experiments.catalogue import experiment
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.recordings.specimens import NO_TIME

TIME = np.linspace(0, 20, 200)
RAMP = 1 + 0.015 * TIME
HOLD = np.interp(TIME, [0, 5, 20], [1, 1.3, 1.3])
CYCLE = np.interp(TIME, [0, 10, 20], [1, 1.3, 1.0])
NAMES = ("viscoelasticity", "softening", "permanent-set", "aging", "anisotropy", "compressibility", "slack")
SIZES = Sizes(energy=1.0, strain=1.0, force=1.0, session=1.0, recording=1.0)
ALONE = Model(energy("neo-hookean"))
WIDENING = {c.key: c for e in entries(SIZES) for c in e.declare(ALONE, ("r0",), ())[2] if c.widens}
CANDIDATES = {n: Candidate(n, (f"effects.{n}.x",)) for n in NAMES} | WIDENING


def sample(*stretches, kind="uniaxial", **attributes):
    made = {}
    for i, stretch in enumerate(stretches):
        told = {k: v[i] for k, v in attributes.items()}
        channel = Channel(TIME, 1000 * (stretch - stretch**-2), "Pa", 1.0)
        made[f"r{i}"] = Recording(f"r{i}", kind, {"time": TIME, "stretch": stretch}, {"nominal_stress": channel}, told)
    return Sample("s", made)


def stresses(model, values, stretch):
    (recording,) = sample(stretch).recordings.values()
    return np.asarray(experiment("uniaxial").predict(model, values, recording).channels["nominal_stress"].values)


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


@pytest.mark.parametrize(("stretch", "more"), [(RAMP, False), (HOLD, True), (CYCLE, True)])
def test_time_is_more_than_strain_where_there_is_a_hold_or_a_way_back(stretch, more):
    assert paced(sample(stretch)) == more
    assert not paced(replace(sample(stretch), notes=NO_TIME))


SLOW = ("effects.drift.rate", "effects.compressibility.drained")


@pytest.mark.parametrize(("stretch", "seen"), [(RAMP, set()), (HOLD, set(SLOW)), (CYCLE, set(SLOW))])
def test_what_goes_slowly_with_time_needs_a_time_that_is_no_strain(stretch, seen):
    drift = [
        Candidate("drift", ("effects.drift.offset",)),
        Candidate("drift", ("effects.drift.offset", SLOW[0]), form="rate"),
    ]
    draining = Candidate("compressibility", ("effects.compressibility.immediate", SLOW[1]))
    kept, _ = offered(sample(stretch, kind="pure-shear"), {c.key: c for c in (*drift, draining)})
    paths = {p for c in kept.values() for p in c.paths}
    assert paths & set(SLOW) == seen
    assert {"effects.drift.offset", "effects.compressibility.immediate"} <= paths


def test_a_drift_along_a_ramp_is_a_strain_energy():
    """On a ramp at one rate c t is c (l - 1) / rate, whose primitive in l is an energy; with a hold it is none."""
    for stretch, alike in ((RAMP, True), (HOLD, False)):
        drift = 7.0 * TIME
        fit = np.polynomial.Polynomial.fit(stretch, drift, 3)(stretch)
        assert (np.max(np.abs(fit - drift)) < 1e-6) == alike


def test_what_remembers_the_way_is_a_strain_energy_until_it_comes_back():
    """Set and softening against a law of strain alone: alike on a ramp at any rate, unlike on the way back."""
    on = [e for e in effects("homogeneous").values() if e.needs.get("homogeneous") == "reversed" and e().parameters]
    assert {e.name for e in on} >= {"permanent-set", "softening"}
    for kind in on:
        added = kind()
        first = {a: 0.3 for a in added.amplitudes} | ({"m": 50.0} if "m" in added.neutral else {})
        model = Model(energy("neo-hookean")).with_effects(added)
        values = {"energy.mu": 1000.0} | {f"effects.{added.name}.{k}": v for k, v in first.items()}
        stress = [stresses(model, values, x) for x in (RAMP, 1 + (RAMP - 1) ** 2 / 0.3, CYCLE)]
        law = PchipInterpolator(RAMP, stress[0])
        up = TIME <= 10
        size = np.max(np.abs(stress[0]))
        assert np.max(np.abs(stress[1] - law(1 + (RAMP - 1) ** 2 / 0.3))) < 1e-4 * size
        assert np.max(np.abs(stress[2] - law(CYCLE))[up]) < 1e-4 * size
        assert np.max(np.abs(stress[2] - law(CYCLE))[~up]) > 1e-2 * size


def test_every_need_is_a_property_of_a_protocol_and_has_words():
    protocol = Protocol.of(sample(RAMP))
    for need in needs("homogeneous").values():
        assert isinstance(getattr(protocol, need), bool)
        assert LACKING[need]


def test_noise_on_the_stretch_is_no_unloading():
    rng = np.random.default_rng(0)
    assert not Protocol.of(sample(RAMP + 1e-4 * rng.standard_normal(len(RAMP)))).reversed


def test_two_rates_show_relaxation_without_a_hold():
    assert "viscoelasticity" in names(RAMP, 1 + 0.25 * (RAMP - 1))
    assert "viscoelasticity" not in names(RAMP, RAMP)


def test_a_pull_that_changes_its_pace_is_not_held():
    quick_at_the_end = np.interp(TIME, [0, 18, 20], [1.0, 1.1, 1.6])  # 45 times as quick, each strain passed once
    assert not names(quick_at_the_end) & {"viscoelasticity"}
    assert not paced(sample(quick_at_the_end))


def test_a_hold_in_which_the_machine_hunts_is_one():
    assert "viscoelasticity" in names(HOLD + 5e-4 * np.sin(2 * np.pi * TIME))  # 0.3 % of the range, up and down


def test_strips_at_right_angles_are_fibres_or_two_strips():
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    kept, _ = offered(sample(CYCLE, CYCLE, direction=(x, y)), CANDIDATES)
    assert {"anisotropy", "specimen-scatter"} <= {c.name for c in kept.values()}
    # else a law's form has a gain of each strip's own, and two strips that differ are another law
    assert all("gain" not in c.widens for c in kept.values() if c.name == "energy-form")


def test_aging_needs_times_and_fibres_need_directions():
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    assert not names(CYCLE, CYCLE, start=(0.0, 0.0), direction=(x, x)) & {"aging", "anisotropy"}
    assert {"aging", "anisotropy"} <= names(CYCLE, CYCLE, start=(0.0, 300.0), direction=(x, y))


def test_a_change_of_volume_needs_tests_of_unlike_constraint():
    assert "compressibility" not in names(CYCLE)
    assert "compressibility" in names(CYCLE, kind="planar")


def test_specimens_can_differ_only_where_recordings_pass_the_same_strains():
    assert "specimen-scatter" not in names(CYCLE)
    assert "specimen-scatter" in names(CYCLE, CYCLE)
    modes = {kind: next(iter(sample(CYCLE, kind=kind).recordings.values())) for kind in ("uniaxial", "planar")}
    kept, remarks = offered(Sample("s", modes), CANDIDATES)
    assert "specimen-scatter" not in kept
    assert any("no strain was passed by several recordings" in r for r in remarks)
    assert "specimen-scatter" not in names(RAMP, 1 - 0.015 * TIME)  # pulled, and pressed
    assert "specimen-scatter" in names(RAMP, 1 + 0.005 * TIME)  # the short one lies in the long one
    untimed = replace(sample(CYCLE, CYCLE), notes=NO_TIME)
    assert "specimen-scatter" in offered(untimed, CANDIDATES)[0]


def test_what_only_widens_the_discrepancy_comes_last_and_the_widest_first():
    kept, _ = offered(sample(CYCLE, CYCLE), CANDIDATES)
    last = list(kept.values())[-3:]
    assert [(c.key, dict(c.widens)) for c in last] == [
        ("specimen-scatter", {"gain": 0.3}),
        ("hysteresis", {"hysteresis": 0.15}),
        ("energy-form/smooth in stretch", {"law": 0.15}),
    ]
    assert not any(c.widens for c in list(kept.values())[:-3])
    alone, _ = offered(sample(CYCLE), CANDIDATES)  # a law of each recording's own is one that fails to carry
    assert dict(alone["energy-form/smooth in stretch"].widens) == {"law": 0.15, "gain": 0.15}
    assert not {c.name for c in offered(sample(CYCLE, CYCLE), CANDIDATES, ("slack",))[0].values() if c.widens}


def test_what_was_left_out_is_said_with_its_reason():
    _, said = offered(sample(RAMP), CANDIDATES)
    assert any("softening" in s and "nothing is unloaded" in s for s in said)
    assert any("aging" in s and "start" in s for s in said)

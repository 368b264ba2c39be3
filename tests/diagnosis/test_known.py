"""Known physics told to a diagnosis: it belongs to the base, and is looked for no more."""

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.explore import Effort
from tissuejax.diagnosis.known import known_physics
from tissuejax.energies.catalogue import energy
from tissuejax.errors import InputError
from tissuejax.recordings.recording import Channel, Recording, Sample

OFFSET, QUICK = 40.0, {"effects": ("drift", "slack"), "effort": Effort(most=1, reshaped=(0, 0, 0))}


@pytest.fixture(scope="module")
def shifted() -> Sample:
    """Pulls and pushes of 500 Pa neo-Hookean tissue, closed form, recorded 40 Pa too high."""
    rng, made, time = np.random.default_rng(3), {}, np.arange(80) * 0.1
    for name, far in (("pull", 1.25), ("push", 0.8), ("last", 1.2)):
        stretch = np.interp(time, [0, 1, 5, 8], [1, 1, far, 1])
        y = 1000 * (stretch - stretch**-2) + OFFSET + 2 * rng.standard_normal(80)
        made[name] = Recording(
            name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": Channel(time, y, "Pa", 2.0)}
        )
    return Sample("s", made)


@pytest.fixture(scope="module")
def found(shifted):
    return diagnose(shifted, "neo-hookean", **QUICK)


def test_what_was_found_is_told_and_nothing_else_is_missing(shifted, found):
    assert found.verdict.judgement.names == ("drift",)
    again = diagnose(shifted, energy("neo-hookean"), known=found.repaired, **QUICK)
    assert again.verdict.kind == "nothing-missing"
    assert again.energy == "neo-hookean with drift"
    assert not any(c["name"] == "drift" for c in again.candidates())
    assert again.verdict.bench.base == ("energy.mu",)
    assert again.verdict.empty.values["energy.mu"] == pytest.approx(1000.0, rel=0.02)


def test_what_is_told_without_a_value_is_fitted_with_the_base(shifted):
    again = diagnose(shifted, "neo-hookean", known=["drift"], **QUICK)
    assert again.verdict.kind == "nothing-missing"
    base = again.verdict.empty
    path = "effects.drift.offset"
    assert base.values[path] == pytest.approx(OFFSET, abs=4 * base.std[path] + 1.0)


def test_weight_is_told_by_its_name_alone():
    assert known_physics(["gravity"], "probing") == {"gravity": {"acceleration": 9.81}}
    given = known_physics(["viscoelasticity.g1=0.3", "effects.friction.coefficient=0.2"], "probing")
    assert given == {"viscoelasticity": {"g1": 0.3}, "friction": {"coefficient": 0.2}}


@pytest.mark.parametrize(
    ("said", "answer"),
    [("frction", "friction"), ("drift", "force-drift"), ("friction.coefficient=much", "NUMBER in SI")],
)
def test_what_can_not_be_told_is_answered(said, answer):
    with pytest.raises(InputError, match=answer):
        known_physics([said], "probing")


def test_an_unknown_parameter_of_a_known_effect(shifted):
    with pytest.raises(InputError, match="offset"):
        diagnose(shifted, "neo-hookean", known=["drift.ofset=3"], **QUICK)

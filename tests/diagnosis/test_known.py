"""Known physics told to a diagnosis: it belongs to the base, and is looked for no more."""

from pathlib import Path

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.known import known_physics
from tissuejax.energies.catalogue import energy
from tissuejax.errors import InputError
from tissuejax.recordings.files import read
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
    [
        ("frction", "friction"),
        ("drift", "force-drift"),
        ("friction.coefficient=much", "NUMBER in SI"),
        ("hysteresis", "hysteresis has no parameters that could be stated"),
    ],
)
def test_what_can_not_be_told_is_answered(said, answer):
    with pytest.raises(InputError, match=answer):
        known_physics([said], "probing")


def test_an_unknown_parameter_of_a_known_effect(shifted):
    with pytest.raises(InputError, match="offset"):
        diagnose(shifted, "neo-hookean", known=["drift.ofset=3"], **QUICK)


def test_the_stiffness_of_a_cuts_tissue_is_told_and_held():
    """The cut is another simulator's (data/make_cut.py: friction 0.1, 20 J/m^2, 3 kPa, wave modulus 36 kPa)."""
    sample = read(Path(__file__).parents[2] / "data/cut.h5")
    told = ["energy.mu=3 kPa", "volumetric.K=32e3", "blade-friction"]
    found = diagnose(sample, "neo-hookean", known=told, effects=["dulling"], effort=QUICK["effort"])
    assert found.energy == "neo-hookean (mu 3000, K 3.2e+04 given) with blade-friction"
    bench = found.verdict.bench
    assert {"energy.mu", "volumetric.K"} & set(bench.base) == set()
    assert (bench.start["energy.mu"], bench.start["volumetric.K"]) == (3000.0, 32e3)
    values = found.verdict.empty.values
    assert values["effects.blade-friction.coefficient"] == pytest.approx(0.1, rel=0.03)  # 0.080 beside an assumed one
    assert values["cohesion.energy"] == pytest.approx(20.0, rel=0.03)
    assert not any("relative to an assumed one" in w for w in bench.warnings)
    open_ = diagnose(sample, "neo-hookean", known=["blade-friction"], effects=["dulling"], effort=QUICK["effort"])
    assert any("--with energy.mu=" in w for w in open_.verdict.bench.warnings)


@pytest.mark.parametrize("said", ["energy.mu", "energy.nu=3kPa", "volumetric.K=3 mm"])
def test_constants_of_a_cuts_tissue_that_say_nothing_are_refused(said):
    sample = read(Path(__file__).parents[2] / "data/cut.h5")
    with pytest.raises(InputError, match=r"told for cuts|constant of the tissue|dimension"):
        diagnose(sample, "neo-hookean", known=[said])


def test_constants_of_the_tissue_are_not_told_where_they_are_fitted():
    with pytest.raises(InputError, match="told for cuts"):
        known_physics(["energy.mu=3kPa"], "homogeneous")

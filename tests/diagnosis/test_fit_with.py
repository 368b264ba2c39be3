"""The command that fits with what a diagnosis named is one that `fit` can take."""

from argparse import Namespace
from types import SimpleNamespace

import pytest

from tests.files.test_plausible import recording, sample
from tissuejax.commands.diagnose import _fit_with

GIVEN = Namespace(file="a b.h5", energy="ogden-2", ogden_form="mu/alpha", known=[], only=[])


def command(*effects, chosen=True, **options):
    told = [
        {"name": name, "parameters": {f"effects.{name}.{p}": {"value": v} for p, v in values.items()}}
        for name, values in effects
    ]
    found = SimpleNamespace(
        as_dict=lambda: {"effects": told, "held_out": ["r2"]}, verdict=SimpleNamespace(chosen=chosen)
    )
    return _fit_with(found, sample(r=recording()), Namespace(**{**vars(GIVEN), **options}))


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ([("viscoelasticity", {"g1": 0.3, "tau1": 2.0})], "--effect viscoelasticity --holdout r2"),
        (
            [
                ("viscoelasticity", {"g1": 0.3, "g2": 0.1, "tau1": 2.0, "tau2": 30.0, "moduli": 1.0}),
                ("slack", {"gap": 0.01}),
            ],
            "--effect viscoelasticity-2 --fix effects.viscoelasticity.moduli=1 --effect slack --holdout r2",
        ),
    ],
)
def test_effects_are_typed_with_their_terms_and_forms(effects, words):
    assert command(*effects) == f"tissuejax fit 'a b.h5' --energy ogden-2 --ogden-form mu/alpha {words}"


def test_nothing_is_advised_where_nothing_was_named_or_fit_can_not_be_told():
    assert command(("slack", {"gap": 0.01}), chosen=False) == ""
    assert command(("slack", {"gap.r1": 0.01})) == ""  # a value of each recording's own
    assert command(("slack", {"width": 0.01})) == ""
    assert command(("slack", {"gap": 0.01}), known=["gravity"]) == ""  # the base holds more than an energy


def test_the_recordings_chosen_are_chosen_again():
    assert command(("slack", {"gap": 0.01}), only=["r"]).endswith("--effect slack --only r --holdout r2")

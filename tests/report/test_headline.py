"""The sentence and the first figure of a diagnosis, by hand."""

import re

import numpy as np
import pytest

from tissuejax.effects.catalogue import effects
from tissuejax.report.effect_words import Found, clauses, said
from tissuejax.report.headline import errors, pooled


def record(held=True):
    before = {
        "pull": {"stress": {"rmse": 3.0, "n": 10, "unit": "Pa", "role": "fitted"}},
        "a": {"stress": {"rmse": 300.0, "n": 10, "unit": "Pa", "role": "held out" if held else "fitted"}},
        "b": {"stress": {"rmse": 400.0, "n": 30, "unit": "Pa", "role": "held out" if held else "fitted"}},
    }
    after = {r: {"stress": cs["stress"] | {"rmse": 4.0}} for r, cs in before.items()}
    return {"before": before, "after": after, "held_out": ["a", "b"] if held else []}


def test_errors_are_pooled_over_what_was_held_out():
    rms = np.sqrt((10 * 300.0**2 + 30 * 400.0**2) / 40)
    assert pooled(record(), "before") == {"Pa": pytest.approx(rms)}
    assert errors(record()) == "held-out error 377 -> 4.0 Pa"
    rms = np.sqrt((10 * 3.0**2 + 10 * 300.0**2 + 30 * 400.0**2) / 50)
    assert pooled(record(held=False), "before") == {"Pa": pytest.approx(rms)}
    assert errors(record(held=False)).startswith("error 338")


def test_words_carry_units_and_leave_out_what_was_not_fitted():
    one = {"g1": Found((0.35036,), "1"), "tau1": Found((2.492,), "s")}
    assert said("viscoelasticity", one) == "35 % of the stress relaxes with 2.5 s"
    two = one | {"g2": Found((0.0512,), "1"), "tau2": Found((40.2,), "s")}
    assert said("viscoelasticity", two).endswith("with 2.5 s, 5.1 % with 40 s")
    off = one | {"g2": Found((0.0,), "1"), "tau2": Found((40.2,), "s")}
    assert said("viscoelasticity", off) == said("viscoelasticity", one)
    each = {"offset": Found((-12.0, 31.0), "Pa")}
    assert said("drift", each) == "the load cell's zero is off by -12 to 31 Pa"
    lump = {n: Found((v,), "m") for n, v in {"x": 0.012, "y": -0.003, "z": 0.02, "radius": 0.006}.items()}
    assert "3.0 times as stiff" in said("inclusion", lump | {"contrast": Found((np.log(3.0),), "1")})


def test_an_effect_by_its_own_name_or_by_that_of_another():
    listed = [
        {"name": "viscoelasticity", "parameters": {
            "effects.nonlinear-viscosity.g": {"value": 0.2, "unit": "1"},
            "effects.nonlinear-viscosity.tau": {"value": 3.0, "unit": "s"},
            "effects.nonlinear-viscosity.stress": {"value": 1500.0, "unit": "Pa"},
        }},
        {"name": "specimen-scatter", "parameters": {}},
        {"name": "energy-form", "parameters": {}},
    ]  # fmt: skip
    assert clauses(listed) == [
        "20 % of the stress flows, with 3.0 s at small load and faster from 1.5 kPa",
        "recordings differ by a stiffness or a gain of their own",
        "the strain energy has another form",
    ]


def test_a_number_smaller_than_its_error_is_not_said():
    def row(value, std, unit):
        return {"value": value, "std": std, "unit": unit}

    two = {"g1": row(0.0056, 0.028, "1"), "tau1": row(0.89, 6.8, "s"), "g2": row(0.49, 0.02, "1")}
    two["tau2"] = row(8.0, 0.2, "s")
    listed = [{"name": "viscoelasticity", "parameters": {f"effects.viscoelasticity.{k}": v for k, v in two.items()}}]
    assert clauses(listed) == ["49 % of the stress relaxes with 8.0 s"]
    two["g2"]["std"] = float("nan")
    assert clauses(listed) == ["viscoelasticity"]


RICH = {"viscoelasticity": {"terms": 5}, "energy-form": {"terms": ("C20", "C30", "C01", "C02", "exponential", "ogden")}}


@pytest.mark.parametrize("name", sorted(effects()))
def test_every_effect_says_what_its_parameters_mean(name):
    known = {p.name for e in variants(name) for p in e.parameters}
    words = effects()[name].words
    assert words, "an effect without words"
    fields = set(re.findall(r"\{(\w+)", " ".join(words)))
    assert fields <= known
    amplitudes = {a for e in variants(name) for a in e.amplitudes}
    assert not fields or fields & amplitudes


def variants(name):
    return [effects()[name](**RICH.get(name, {}))]

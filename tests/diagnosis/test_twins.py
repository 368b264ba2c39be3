"""Two relaxation times that came out as one are shown as one, with an error that says how well it is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.answer import shown_fit
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.twins import merged
from tissuejax.effects.viscoelasticity import Viscoelasticity
from tissuejax.fitting.advice import _twins
from tissuejax.recordings.recording import Channel, Recording, Sample

V = "effects.viscoelasticity."
MU, G, TAU, NOISE = 1000.0, 0.3, 2.0, 2.0


def three(values):
    paths = {n: V + n for n in ("g1", "g2", "g3", "tau1", "tau2", "tau3")}
    c = Candidate("viscoelasticity", tuple(paths[f"g{i}"] for i in (1, 2, 3)),
                  tuple(paths[f"tau{i}"] for i in (1, 2, 3)), form="three times of the moduli")  # fmt: skip
    return merged(c, {paths[n]: v for n, v in values.items()}, Criteria().twins)


def test_shares_of_like_times_are_added():
    c, start = three({"g1": 0.1, "g2": 0.2, "g3": 0.05, "tau1": 5.0, "tau2": 0.4, "tau3": 5.1})
    assert c.form == "two times of the moduli"
    assert c.paths == (V + "g1", V + "g2", V + "tau1", V + "tau2")
    assert start == pytest.approx({V + "g1": 0.15, V + "g2": 0.2, V + "tau1": 5.0, V + "tau2": 0.4})


def test_times_apart_stay_two():
    assert three({"g1": 0.1, "g2": 0.2, "g3": 0.05, "tau1": 5.0, "tau2": 0.4, "tau3": 5.6}) is None


def relaxing():
    """Ramp and hold of a neo-Hookean specimen whose nominal stress relaxes: closed form for a ramp in the stress."""
    time = np.arange(0, 20, 0.1)
    elastic = 300.0 * np.minimum(time, 1.0)  # Pa
    ramp = TAU * (np.exp(-np.maximum(time - 1, 0) / TAU) - np.exp(-time / TAU))  # int of exp(-(t-s)/tau) over the ramp
    stress = (1 - G) * elastic + G * 300.0 * ramp
    grid = np.linspace(1.0, 1.3, 4001)
    stretch = np.interp(elastic, MU * (grid - grid**-2), grid)
    stress = stress + NOISE * np.random.default_rng(1).standard_normal(len(time))
    r = Recording("hold", "uniaxial", {"time": time, "stretch": stretch},
                  {"nominal_stress": Channel(time, stress, "Pa", NOISE)})  # fmt: skip
    return Sample("s", {"hold": r})


@pytest.mark.slow
def test_a_diagnosis_shows_one_time():
    found = diagnose(relaxing(), "neo-hookean", effects=("viscoelasticity",)).answered
    # richer forms were weighed, one of them was a nat likelier, and their further shares have no error worth the name
    assert found.judgement.chosen.keys == ("viscoelasticity/one time",)
    for name, true in (("g1", G), ("tau1", TAU)):
        assert found.chosen.values[V + name] == pytest.approx(true, abs=4 * found.chosen.std[V + name])
    e, alone, key = found.exploration, found.chosen, "viscoelasticity/two times"
    at = {"energy.mu": MU, V + "g1": G / 2, V + "g2": G / 2, V + "tau1": TAU, V + "tau2": TAU}
    known = e.weighed[frozenset({"viscoelasticity/one time"})]
    e.weighed[frozenset({key})] = replace(known, refit=replace(known.refit, values=at))
    fit = shown_fit(found, (key,))
    assert fit.values == pytest.approx(alone.values, rel=1e-3)
    assert fit.std == pytest.approx(alone.std, rel=1e-2)
    assert found.bench.candidates[key].form == "one time"


def test_a_fit_says_that_one_term_would_do():
    effect = Viscoelasticity(terms=2)
    predictor = SimpleNamespace(model=SimpleNamespace(effects=(effect,)))
    values = {V + "g1": 0.2, V + "g2": 0.15, V + "tau1": 8.0, V + "tau2": 8.01}
    found = SimpleNamespace(problem=SimpleNamespace(predictor=predictor), free=tuple(values), values=values)
    (said,) = _twins(found)
    assert "0.35" in said
    assert "viscoelasticity-1" in said
    found.values = {**values, V + "tau2": 80.0}
    assert _twins(found) == []

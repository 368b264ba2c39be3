"""Parameters that swallow missing physics come back once it is named: the table of the page, by closed forms."""

import json
from pathlib import Path

import pytest

import tissuejax as tj


@pytest.mark.slow
def test_the_stiffness_comes_back_once_relaxation_is_named():
    truth = json.loads(Path("data/demo/truth.json").read_text())["relaxing"]
    found = tj.diagnose("data/demo/relaxing.h5", energy="reduced-polynomial-2").as_dict()
    assert (found["verdict"], [e["name"] for e in found["effects"]]) == ("found", ["viscoelasticity"])
    base, (effect,) = found["base_parameters"], found["effects"]
    assert base["energy.C10"]["before"] < 0.6 * truth["energy.C10"]  # and sure of it
    assert base["energy.C10"]["before"] + 10 * base["energy.C10"]["before_std"] < truth["energy.C10"]
    pairs = [(base[p]["after"], base[p]["after_std"], truth[p]) for p in ("energy.C10", "energy.C20")]
    inner = {k.rpartition(".")[2]: x for k, x in effect["parameters"].items()}
    pairs += [(inner[k]["value"], inner[k]["std"], truth[t]) for k, t in (("g1", "fraction"), ("tau1", "tau"))]
    for value, std, true in pairs:
        assert value == pytest.approx(true, abs=3 * std)
        assert std < 0.02 * true
    held = [x["holdout"]["nominal_stress"]["rmse"] for x in (found["before"], found["after"])]
    assert held[0] > 20 * truth["noise_std"]
    assert held[1] < 1.1 * truth["noise_std"]

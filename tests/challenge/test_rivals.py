"""Rivals read off a result, and the Gaussian process, on answers and data made by hand."""

import json

import numpy as np
import pytest

from tissuejax.challenge import files, rivals
from tissuejax.challenge.compare import compare
from tissuejax.challenge.make import make
from tissuejax.challenge.material_cases import draw
from tissuejax.storage import write_json

RESULT = {
    "candidates": [
        {
            "name": "slack",
            "score": 50.0,
            "refit_chi2_per_sample": 2.0,
            "criterion": -90.0,
            "held_out_chi2_per_sample": 1.5,
        },
        {
            "name": "aging",
            "score": 80.0,
            "refit_chi2_per_sample": 2.5,
            "criterion": -40.0,
            "held_out_chi2_per_sample": 9.0,
        },
        {
            "name": "drift",
            "score": 5.0,
            "refit_chi2_per_sample": 3.0,
            "criterion": 3.0,
            "held_out_chi2_per_sample": 1.2,
        },
    ],
    "sets": [
        {"effects": ["aging"], "information_criterion": 80.0, "held_out_chi2_per_sample": 9.0},
        {"effects": ["slack", "drift/each recording"], "information_criterion": 30.0, "held_out_chi2_per_sample": 1.1},
        {"effects": [], "information_criterion": 99.0, "held_out_chi2_per_sample": 4.0},
    ],
    "before": {"r4": {"nominal_stress": {"chi2_per_sample": 4.0, "role": "held out"}}},
}


def test_each_criterion_names_its_own_favourite():
    assert rivals.by_score(RESULT) == (("aging",), 9.0)
    assert rivals.by_refit(RESULT) == (("slack",), 1.5)
    assert rivals.by_hold_out(RESULT) == (("drift",), 1.2)
    assert rivals.by_all_subsets(RESULT) == (("slack", "drift"), 1.1)


def test_a_set_whose_refit_broke_down_is_no_rival():
    broken = {"effects": ["aging"], "information_criterion": None, "held_out_chi2_per_sample": None}
    assert rivals.by_all_subsets(RESULT | {"sets": [broken, *RESULT["sets"]]}) == (("slack", "drift"), 1.1)


def test_nothing_to_name():
    quiet = {"candidates": [], "sets": [], "before": {}}
    for ask in (rivals.by_score, rivals.by_refit, rivals.by_hold_out, rivals.by_all_subsets):
        assert ask(quiet) == ((), np.inf)


def test_gaussian_process_learns_a_drift(tmp_path):
    case = draw("x", 2, 0, "one", 7)
    assert case.key["effects"] == ["drift"]
    files.write_material(case, tmp_path / "x.h5")
    found = rivals.discrepancy(tmp_path / "x.h5", case.energy, most=150)
    size = case.key["size_over_noise"]["drift"]
    assert found.fitted < 0.5 * (1 + size**2) + 0.6
    assert np.isfinite(found.held_out)
    trials, stress, noise = rivals.trials_of(tmp_path / "x.h5")
    assert noise == pytest.approx(case.noise)
    assert np.array_equal(stress["r1"], case.stress["r1"])
    assert [t.name for t in trials] == [t.name for t in case.trials]


def test_rivals_are_marked_like_the_diagnosis(tmp_path):
    make(tmp_path, count=3, seed=5)
    keys = json.loads((tmp_path / "sealed" / "keys.json").read_text())
    for name, key in keys.items():
        answer = RESULT | {
            "verdict": "found",
            "effects": [{"name": n} for n in key["effects"]],
            "after": {key["held_out"]: {"nominal_stress": {"chi2_per_sample": 1.0}}},
        }
        write_json(tmp_path / "results" / name / "result.json", answer)
        write_json(tmp_path / "results" / name / "cost.json", {"seconds": 2.0})
    found = compare(tmp_path, every=len(keys))
    ours, subsets = (found["rivals"][w] for w in ("diagnosis", "information criterion over all sets refitted"))
    single = "single above 3 noise: right and no other"
    assert ours[single]["share"] in (1.0, None)
    assert ours["seconds"]["median"] == 2.0
    # every rival names something in every case: a false alarm wherever there is nothing
    assert subsets["nulls: false alarm"]["share"] in (1.0, None)
    ratios = [np.sqrt(1.1) / key["truth_error_over_noise"][key["held_out"]] for key in keys.values()]
    known = [r for r, key in zip(ratios, keys.values()) if key["category"] != "unknown"]
    assert subsets["held_out_error_over_truth"]["median"] == pytest.approx(np.median(known))
    assert (tmp_path / "rivals.csv").read_text().count("\n") == 7


def test_of_probings_the_names_are_compared(tmp_path, monkeypatch):
    """No Gaussian process over stretch and rate there, and no held-out error pooled over force and markers."""
    truth = {"r3": {"force": 1.0, "markers": 1.0}}
    common = {"held_out": "r3", "truth_error_over_noise": truth, "plain": {}, "tolerated": [], "noise": {}}
    keys = {
        "p0": common | {"category": "one", "effects": ["adhesion"], "size_over_noise": {"adhesion": 4.0}},
        "p1": common | {"category": "none", "effects": [], "size_over_noise": {}},
    }
    manifest = {"kind": "probing", "cases": [{"name": n, "energy": "reduced-polynomial-2"} for n in keys]}
    monkeypatch.setattr(files, "read_manifest", lambda folder: manifest)
    monkeypatch.setattr(files, "read_keys", lambda folder, manifest: keys)
    for name, key in keys.items():
        answer = RESULT | {"verdict": "found", "effects": [{"name": n} for n in key["effects"]], "after": {}}
        write_json(tmp_path / "results" / name / "result.json", answer)
        write_json(tmp_path / "results" / name / "cost.json", {"seconds": 2.0})
    found = compare(tmp_path)["rivals"]
    assert "Gaussian-process discrepancy" not in found
    assert found["diagnosis"]["single above 3 noise: right and no other"]["share"] == 1.0
    assert found["score ranking alone"]["single above 3 noise: right and no other"]["share"] == 0.0
    assert found["score ranking alone"]["nulls: false alarm"]["share"] == 1.0

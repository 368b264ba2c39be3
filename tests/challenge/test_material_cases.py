"""Drawn cases: the same from the same seed, sizes as asked for, noise as recorded, files without the truth."""

import json

import numpy as np
import pytest

from tissuejax.challenge.files import read_keys, read_manifest
from tissuejax.challenge.grade import grade, rate
from tissuejax.challenge.make import make
from tissuejax.challenge.material_cases import CATEGORIES, category, draw
from tissuejax.challenge.menu import NAMES, STRAY
from tissuejax.challenge.run import run
from tissuejax.errors import InputError
from tissuejax.recordings.files import read


def test_same_seed_same_case():
    one, two = draw("a", 5, 3, "one", 2), draw("a", 5, 3, "one", 2)
    assert one.key == two.key
    assert all(np.array_equal(one.stress[n], two.stress[n]) for n in one.stress)
    assert draw("a", 6, 3, "one", 2).key != one.key


def test_every_effect_and_every_stray_can_be_drawn():
    for i, name in enumerate(NAMES):
        case = draw("x", 11, i, "one", i)
        assert case.key["effects"] == [name]
        assert 0.3 < case.key["size_over_noise"][name] < 40
    for i, stray in enumerate(STRAY):
        case = draw("x", 11, i, "unknown", i)
        assert case.key["effects"] == [stray.name]
        assert all(np.all(np.isfinite(s)) for s in case.stress.values())


def test_nothing_missing_leaves_noise_only():
    case = draw("x", 3, 0, "none")
    assert case.key["all_over_noise"] == pytest.approx(0.0, abs=1e-8)
    assert case.key["effects"] == []


def test_categories_keep_their_shares():
    kinds = [category(i) for i in range(1000)]
    shares = [kinds.count(c) / 1000 for c in CATEGORIES]
    np.testing.assert_allclose(shares, (0.20, 0.45, 0.14, 0.06, 0.15), atol=0.01)


@pytest.fixture(scope="module")
def challenge(tmp_path_factory):
    folder = tmp_path_factory.mktemp("challenge")
    make(folder, "material", 6, seed=4)
    return folder


def test_files_hold_recordings_and_no_truth(challenge):
    manifest = read_manifest(challenge)
    keys = read_keys(challenge, manifest)
    assert len(keys) == 6
    for entry in manifest["cases"]:
        sample = read(challenge / "cases" / f"{entry['name']}.h5")
        assert list(sample.recordings)[-1] == keys[entry["name"]]["held_out"]
        assert len(sample.recordings) >= 4
        assert sample.notes == ""


def test_making_again_is_free_and_another_one_is_refused(challenge):
    assert make(challenge, "material", 6, seed=4) == read_manifest(challenge)
    with pytest.raises(InputError, match="another challenge"):
        make(challenge, "material", 6, seed=5)
    with pytest.raises(InputError, match="as many or more"):
        make(challenge, "material", 5, seed=4)


def test_a_larger_count_fills_up_and_leaves_the_cases_that_are_there(tmp_path):
    few = make(tmp_path, "material", 2, seed=8)
    more = make(tmp_path, "material", 3, seed=8)
    assert more["cases"][:2] == few["cases"]
    assert len(more["cases"]) == 3
    assert more["keys_sha256"] != few["keys_sha256"]


def test_changed_keys_are_not_graded(tmp_path):
    make(tmp_path, "material", 2, seed=8)
    path = tmp_path / "sealed" / "keys.json"
    path.write_text(path.read_text().replace("category", "categorx"))
    with pytest.raises(InputError, match="keys were changed"):
        grade(tmp_path)


def test_changed_case_is_not_run(tmp_path):
    make(tmp_path, "material", 1, seed=8)
    (tmp_path / "cases" / "m000.h5").write_bytes(b"")
    with pytest.raises(InputError, match="not the file that was made"):
        run(tmp_path)


def test_grading_by_hand_made_answers(challenge):
    manifest = read_manifest(challenge)
    keys = read_keys(challenge, manifest)
    with pytest.raises(InputError, match="no results"):
        grade(challenge)
    for name, key in keys.items():
        verdict = {"none": "nothing-missing", "unknown": "unexplained"}.get(key["category"], "found")
        truth = key["truth_error_over_noise"][key["held_out"]]
        answer = {
            "verdict": verdict,
            "effects": [{"name": n} for n in key["effects"]] if verdict == "found" else [],
            "after": {key["held_out"]: {"nominal_stress": {"chi2_per_sample": (1.05 * truth) ** 2}}},
            "confidence": 0.9,
        }
        path = challenge / "results" / name / "result.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(answer))
    found = grade(challenge)
    assert found["answered"] == 6
    assert found["held_out_error_over_truth"]["known physics"]["median"] == pytest.approx(1.05)
    for name, r in found["rates"].items():
        if r["of"]:
            assert r["share"] == (0.0 if "false alarm" in name or "failed" in name else 1.0), name
    assert (challenge / "graded.csv").read_text().count("\n") == 7


def test_wilson_interval():
    r = rate([True] * 19 + [False], bool)
    assert (r["low"], r["high"]) == pytest.approx((0.7639, 0.9911), abs=1e-3)

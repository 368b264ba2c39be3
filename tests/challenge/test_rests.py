"""Rests: every law against what it claims, and the sizes, places and noise of whole cases by independent numbers."""

import json
import math

import numpy as np
import pytest

from tissuejax.challenge import files, measured, places, rest_cases
from tissuejax.challenge.make import make, seed_of
from tissuejax.challenge.material import Specimen, reported
from tissuejax.challenge.probing_bench import Record as Press
from tissuejax.challenge.probing_rest import beside
from tissuejax.challenge.probing_sizes import by_channel, where
from tissuejax.challenge.protocols import trials
from tissuejax.challenge.rest_marks import mark_rest, true_size
from tissuejax.challenge.rests import rests
from tissuejax.challenge.rests.play import play
from tissuejax.challenge.rests.rest import Record
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body
from tissuejax.errors import InputError

BODY = Body({"10": 600.0, "20": 300.0})


def records():
    plan = trials(np.random.default_rng(3), rare=False)
    stress = [reported(Specimen(BODY), t) for t in plan]
    top = max(np.abs(s).max() for s in stress)
    return [Record(t, s, BODY, top) for t, s in zip(plan, stress)]


@pytest.mark.parametrize("name", sorted(rests()))
def test_a_law_changes_every_recording_by_something_that_no_modulus_takes_up(name):
    change = rests()[name].change(np.random.default_rng(1), records())
    again = rests()[name].change(np.random.default_rng(1), records())
    for r, x, y in zip(records(), change, again):
        assert x.shape == r.stress.shape
        assert np.all(np.isfinite(x))
        np.testing.assert_array_equal(x, y)  # the generator alone decides
    flat = np.concatenate([x.ravel() for x in change])
    own = np.concatenate([r.stress.ravel() for r in records()])
    left = flat - own * (flat @ own) / (own @ own)
    assert np.linalg.norm(left) > 0.1 * np.linalg.norm(flat)


def test_there_are_at_least_nine_laws_and_most_have_no_name_in_a_catalogue_today():
    assert len(rests()) >= 9


def test_play_lags_by_its_gap_and_keeps_still_inside_it():
    x = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0, 101)])
    out = play(x, 0.2)
    assert out[100] == pytest.approx(0.8)  # pushed up to 1 - gap
    assert out[100 + 30] == pytest.approx(0.8)  # turned, still inside
    assert out[-1] == pytest.approx(0.2)  # dragged down to 0 + gap


def test_noise_has_its_level_and_its_time_on_any_sampling():
    rng = np.random.default_rng(0)
    s = measured.Sensor(3.0, 0.6, 0.5, None)
    time = np.sort(rng.uniform(0, 4000, 20000))
    x = measured.noise(rng, s, time)
    assert np.std(x) == pytest.approx(3.0, rel=0.05)
    gap = np.diff(time)
    near = gap < 0.1
    # correlation of neighbours: share * exp(-gap / time)
    expected = 0.6 * np.mean(np.exp(-gap[near] / 0.5))
    assert np.mean(x[:-1][near] * x[1:][near]) / 9.0 == pytest.approx(expected, abs=0.06)


def test_a_recorder_with_sparse_holds_keeps_every_moving_sample():
    time = np.arange(0, 20, 0.04)
    drive = 1 + 0.2 * np.clip(time - 1, 0, 2) / 2
    trial = Trial("r", "uniaxial", time, drive, np.eye(3)[0], 0.0, 1e-4, 0.01, 0.01)
    for seed in range(40):
        rows = measured.kept_rows(np.random.default_rng(seed), trial)
        moving = np.flatnonzero(np.diff(drive) > 1e-9) + 1
        if len(rows) < 0.4 * len(time) and len(rows) not in (len(time[::5]), len(time[::2])):
            assert set(moving) <= set(rows)
            return
    pytest.fail("no seed drew sparse holds")


@pytest.fixture(scope="module")
def drawn():
    """One case of each category."""
    found = {}
    for i in range(12):
        case, kept, stress = rest_cases.draw(f"s{i}", 11, i)
        found.setdefault(case.key["category"], (case, kept, stress))
        if len(found) == 3:
            break
    return found


def test_every_category_is_drawn_at_the_asked_ratio(drawn):
    assert set(drawn) == {"one", "two", "rest"}
    for kind, (case, kept, stress) in drawn.items():
        key = case.key
        assert 0.05 <= key["rest"]["ratio"] <= 0.5
        assert len(key["effects"]) == {"one": 1, "two": 2, "rest": 0}[kind]
        assert all(size > 2.9 for size in key["size_over_noise"].values())
        assert kept.name not in {t.name for t in case.trials}
        assert stress.shape[0] == len(kept.time)
        weakest = min(key["size_over_noise"].values(), default=key["rest"]["over_noise"] / key["rest"]["ratio"])
        assert key["rest"]["over_noise"] == pytest.approx(key["rest"]["ratio"] * weakest)
        # rms over the fitted recordings of the file is what was asked for, but for the rows that the recorder left out
        fitted = [t.name for t in case.trials[:-1]]
        squares = sum(key["rest"]["beyond_rms"][n] ** 2 * key["samples"][n] for n in fitted)
        rms = np.sqrt(squares / sum(key["samples"][n] for n in fitted))
        assert rms / key["noise"]["std"] == pytest.approx(key["rest"]["over_noise"], rel=0.5)


def test_the_fewest_places_that_hold_four_fifths():
    assert places.most_of({"a": 0.5, "b": 0.35, "c": 0.15}) == ["a", "b"]
    assert places.agreement(["a", "b"], ["b", "c"]) == (1, 1, 1)
    located = [
        {"kind": "recording", "recording": "r1", "share": 0.9},
        {"kind": "recording", "recording": "r2", "share": 0.1},
        {"kind": "phase", "recording": "all", "phase": "hold", "share": 0.85, "what": "hold: 2 times its share"},
        {"kind": "phase", "recording": "all", "phase": "loading", "share": 0.15, "what": ""},
    ]
    assert places.stated(located) == (["r1"], ["hold"])


def key(effects, tolerated=(), beyond=10.0):
    return {
        "category": {0: "rest", 1: "one", 2: "two"}[len(effects)],
        "effects": list(effects),
        "alike": False,
        "tolerated": list(tolerated),
        "rest": {"laws": {"play": 1.0}, "ratio": 0.2, "beyond_rms": {"r1": beyond, "r2": beyond}},
        "samples": {"r1": 10, "r2": 30},
        "where": {"recordings": ["r1"], "phases": ["hold"]},
        "kept_rms": {"rest": 4.0},
    }


def said(verdict, *names, **more):
    return {"verdict": verdict, "effects": [{"name": n} for n in names], **more}


@pytest.mark.parametrize(
    ("truth", "answer", "right"),
    [
        (("slack",), said("found-in-part", "slack"), True),
        (("slack",), said("found", "slack", "hysteresis"), True),  # true of the rest
        (("slack",), said("found", "slack", "aging"), False),
        (("slack",), said("unexplained"), False),
        (("slack", "drift"), said("found", "slack"), False),
        ((), said("unexplained"), True),
        ((), said("found", "energy-form"), True),  # claims no process
        ((), said("found-in-part", "slack"), False),
        ((), said("failed"), False),
    ],
)
def test_an_answer_beside_a_rest(truth, answer, right):
    assert mark_rest("s", key(truth, ["hysteresis"]), answer).right is right


@pytest.mark.parametrize(
    ("truth", "answer", "apt"),
    [
        (("slack",), said("ambiguous", alternatives=[{"effects": ["slack"]}]), True),
        (("slack",), said("ambiguous", alternatives=[{"effects": ["drift"]}]), False),
        ((), said("ambiguous", alternatives=[{"effects": ["drift"]}]), False),
        (("slack", "drift"), said("found-in-part", "slack"), True),  # says itself that there is more
        (("slack", "drift"), said("found", "slack"), False),
        (("slack",), said("unexplained"), False),
        ((), said("unexplained"), True),
    ],
)
def test_what_confidence_is_about(truth, answer, apt):
    assert mark_rest("s", key(truth), answer).apt is apt


def test_size_of_the_rest_and_what_was_tried():
    assert true_size(key(())) == pytest.approx(10.0)
    m = mark_rest("s", key(("slack",)), said("found", "slack", rest={"rms": 15.0}, sets=[{"effects": ["slack/sharp"]}]))
    both = mark_rest("s", key(("slack",)), said("found", "slack", rest={"rms": 0.02, "unit": "1"}))
    assert np.isnan(both.rest_over_true)  # forces and markers together are no force
    assert m.rest_over_true == pytest.approx(1.5)
    assert m.tried is True
    assert mark_rest("s", key(("slack",)), said("unexplained", sets=[{"effects": ["drift/linear"]}])).tried is False
    assert mark_rest("s", key(("slack",)), said("unexplained"), kept=8.0).kept_ratio == pytest.approx(2.0)


def test_size_of_the_rest_beside_the_true_effects_whatever_was_named():
    """Peak 100 Pa: 2 Pa of rest are stated at 0.02 of it, beside slack alone there are 9 Pa."""
    answer = said("found", "slack", "hysteresis", rest={"rms": 2.0, "share_of_peak": 0.02})
    rows = [
        ({"slack", "hysteresis"}, -10.0, 0.02),
        ({"slack"}, -30.0, 0.05),
        ({"slack"}, -20.0, 0.09),  # another form, likelier
        ({"slack"}, -math.inf, 0.01),  # can't be predicted
        (set(), -90.0, 0.5),
    ]
    evidence = {"sets": [{"names": sorted(n), "log_evidence": e, "rest": [x**2, 0.0]} for n, e, x in rows]}
    m = mark_rest("s", key(("slack",), ["hysteresis"]), answer, evidence=evidence)
    assert m.rest_over_true == pytest.approx(0.2)
    assert m.beside_true == pytest.approx(0.9)
    untried = mark_rest("s", key(("drift",)), answer, evidence=evidence)
    assert np.isnan(untried.beside_true)
    assert np.isnan(mark_rest("s", key(("slack",)), answer).beside_true)


def test_probings_keep_no_recording_back_and_are_graded():
    told = json.loads(json.dumps(key(("slack",)) | {"kept_rms": {"rest": None}}))
    m = mark_rest("p", told, said("found", "slack"))
    assert m.right is True
    assert np.isnan(m.kept_ratio)


def test_the_seed_belongs_to_the_commit_and_to_the_kind(tmp_path):
    commit = "0" * 40
    assert seed_of(commit, "rest", {}) != seed_of(commit, "material", {})
    with pytest.raises(InputError, match="40 digits"):
        seed_of("abc", "rest", {})
    manifest = make(tmp_path, "rest", 2, commit=commit)
    assert manifest["seed"] == seed_of(commit, "rest", {})
    assert make(tmp_path, "rest", 2, commit=commit) == manifest  # nothing is made twice
    keys = files.read_keys(tmp_path, manifest)
    assert set(keys) == {"s000", "s001"}
    kept = np.load(tmp_path / "sealed" / "kept" / "s000.npy")
    assert np.any(kept != 0)
    assert "rest" not in (tmp_path / "manifest.json").read_text().replace('"kind": "rest"', "")
    json.dumps(keys)


def press(name, start, force):
    time = np.linspace(0, 4, 250)
    depth = 4e-3 * np.interp(time, [0, 1, 2, 3, 4], [0, 1, 1, 0, 0])
    probe = np.stack([0 * time, 0 * time, 0.03 - depth], -1)
    value = force * np.stack([0.05 * depth, 0 * depth, depth**1.5 * 1e3], -1)
    return Press(name, start, 0.009, time, probe, time, value, time[::4], np.zeros((63, 2, 3)))


def test_a_probing_s_rest_is_the_asked_share_and_leaves_the_markers():
    bare = [press(f"r{i}", 100.0 * i, 1.0) for i in range(3)]
    clean = [press(f"r{i}", 100.0 * i, 1.2 - 0.3 * i) for i in range(3)]
    found = beside(np.random.default_rng(2), clean, bare, [8.0, 12.0], (0.003, 5e-5))
    assert found.key["where"]["channels"]
    assert found.key["rest"]["over_noise"] == pytest.approx(8.0 * found.key["rest"]["ratio"])
    squares = [found.key["rest"]["beyond_rms"][n] ** 2 for n in ("r0", "r1")]
    assert np.sqrt(np.mean(squares)) / 0.003 == pytest.approx(found.key["rest"]["over_noise"], rel=1e-6)
    for a, b in zip(clean, found.presses):
        assert a.markers is b.markers
        assert np.any(a.force != b.force)
    assert set(found.key["where"]["phases"]) <= set(places.PHASES)


def located(**channels: float) -> list[dict]:
    return [{"kind": "recording", "recording": "r1", "channel": n, "share": s} for n, s in channels.items()] + [
        {"kind": "phase", "recording": "all", "channel": "markers", "phase": "hold", "share": 0.9}
    ]


def test_channels_of_a_probing_s_misfit_by_algebra():
    """Bare force a along z; the effect adds 3 noises across and moves markers by 2: what a factor can't take up."""
    noise, t = (0.003, 5e-5), np.linspace(0.0, 1.0, 40)
    along, across = np.sin(np.pi * t), np.cos(np.pi * t)  # orthogonal, so that the factor of the force stays one

    def made(side: float, moved: float) -> Press:
        force = np.stack([side * across, 0 * t, 0.3 * along], -1)
        markers = np.full((40, 2, 3), moved)
        return Press("r", 0.0, 0.009, t, np.zeros((40, 3)), t, force, t, markers)

    found = by_channel([made(0.0, 0.0)], [made(3 * noise[0], 2 * noise[1])], noise)
    rms = float(np.sqrt(np.mean(across**2)))
    assert {n: size for n, (size, _) in found.items()} == pytest.approx(
        {"force x": 3 * rms, "force y": 0.0, "force z": 0.0, "markers": 2.0}, abs=1e-9
    )
    assert found["markers"][1] == pytest.approx(4 * 240)  # 40 samples of 2 markers with 3 components
    assert found["force x"][1] == pytest.approx(9 * np.sum(across**2))
    assert where(found)["channels"] == ["markers"]  # 960 of 960 + 9 * 21 hold four fifths
    assert where(by_channel([made(0.0, 0.0)], [made(3 * noise[0], 0.0)], noise))["channels"] == ["force x"]
    assert where(by_channel([made(0.0, 0.0)], [made(0.5 * noise[0], 0.0)], noise))["channels"] == []


def test_f1_of_channels_counts_cases_whose_key_names_any():
    keys = [{"where": {"channels": ["markers"]}}, {"where": {"channels": ["force x", "force z"]}}, {}]
    said = [located(**{"markers": 0.9, "force z": 0.1}), located(**{"force z": 0.6, "markers": 0.4}), located()]
    counts = [places.channels_found(k, {"located": s}) for k, s in zip(keys, said)]
    assert counts == [(1, 0, 0), (1, 1, 1), None]
    assert places.channel_f1(counts) == {"f1": pytest.approx(2 * 2 / (2 * 2 + 1 + 1)), "of": 2}
    assert places.channel_f1([None]) == {"f1": None, "of": 0}

"""What a linear step of an effect promises, where all is a straight line: chi-squares and prices in dense matrices."""

import math
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from straight_bench import DRIVE, GAIN, Straight, as_weighed, covariance, scales_of, straight

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.nominate import nominated

USUAL = Criteria()
AT = {"a": 10.0, "b": 20.0}
BEFORE = SimpleNamespace(
    odds={"gap": 0.1, "push": 1.0, "shift": 0.1, "own": 1.0, "noted": 0.1, "bend": 1.0},
    forms={"gap": 1, "push": 1, "shift": 1, "own": 3, "noted": 1, "bend": 2},
)


def told(bench, *keys, v=(0.0,), at=None):
    """The scores of these candidates beside the base, by key, and the scales."""
    scales = scales_of(bench)
    left = [bench.candidates[k] for k in keys]
    found = nominated(bench, scales, as_weighed(scales, at or AT, v, (GAIN,)), left, USUAL, BEFORE)
    return found, scales


def projected(scales, v: float) -> np.ndarray:
    """Of the inverse covariance what no constant of the base takes up."""
    inverse = np.linalg.inv(covariance(scales, [GAIN], [v]))
    jac = scales.cut.mean(scales.bench.jacobian({}, ("a", "b")))
    return inverse - inverse @ jac @ np.linalg.solve(jac.T @ inverse @ jac, jac.T @ inverse)


def usual_sizes(scales, c: np.ndarray, share: float) -> np.ndarray:
    stress = scales.cut.mean(scales.bench.predict(AT))
    return share * np.sqrt(np.sum(stress**2) / np.sum(c**2, axis=0))


def promised(scales, left, c: np.ndarray, share: float, name: str, v: float) -> tuple[float, np.ndarray]:
    """Nats that these columns gain within no bounds, less what they could have done; and the step."""
    p, size = projected(scales, v), usual_sizes(scales, c, share)
    h = c.T @ p @ c
    step = np.linalg.solve(h, c.T @ p @ left)
    price = 0.5 * np.linalg.slogdet(np.eye(len(h)) + h * np.outer(size, size))[1]
    return 0.5 * step @ h @ step - price + math.log(BEFORE.odds[name] / BEFORE.forms[name]), step


@pytest.mark.parametrize(
    ("truth", "paths", "share"),
    [
        ({"own.x": 0.3}, ("own.x",), USUAL.change),
        ({"shift.x": 0.2, "shift.y": -0.1}, ("shift.x", "shift.y"), USUAL.rig),
    ],
)
@pytest.mark.parametrize("v", [0.0, 1e-3])
def test_a_step_gains_what_the_whitened_residual_loses_less_its_price(truth, paths, share, v):
    """Under the discrepancy that the set has, or that of its prior's size, whichever makes more of it."""
    bench = straight(truth)
    name = paths[0].split(".")[0]
    (found,), scales = told(bench, name, v=(v,))
    left, c = scales.cut.mean(bench.y - bench.predict(AT)), scales.cut.mean(bench.jacobian({}, paths))
    ways = [(*promised(scales, left, c, share, name, x), x) for x in (v, USUAL.shares["gain"] ** 2)]
    worth, step, under = max(ways, key=lambda way: way[0])
    assert found.gain == pytest.approx(worth, rel=1e-6)
    assert [found.step[p] for p in paths] == pytest.approx(list(step), rel=1e-6)
    assert found.share == pytest.approx(min(2 * worth / (left @ projected(scales, under) @ left), 1.0), rel=1e-6)
    assert np.linalg.norm(found.direction) == pytest.approx(1.0)
    assert found.key == name


def test_a_step_to_the_other_side_is_none_and_costs_its_price():
    bench = straight({"push.k": -3.0})
    (found,), scales = told(bench, "push")
    c = scales.cut.mean(bench.jacobian({}, ("push.k",)))
    usual = USUAL.shares["gain"] ** 2
    prices = [
        0.5
        * math.log(1 + float((c.T @ projected(scales, v) @ c).item() * usual_sizes(scales, c, USUAL.change)[0] ** 2))
        for v in (0.0, usual)
    ]
    assert found.step["push.k"] == pytest.approx(0.0, abs=1e-9)
    assert found.gain == pytest.approx(-min(prices), rel=1e-6)
    assert found.share == 0.0
    assert np.linalg.norm(found.direction) == pytest.approx(0.0, abs=1e-9)


def test_from_an_amplitude_that_is_scanned_a_one_sided_step_may_go_back_to_nothing():
    bench = straight({"push.k": -3.0})
    bench.candidates["push"] = replace(bench.candidates["push"], grid=({"push.k": 1.5},))
    (found,), _ = told(bench, "push")
    assert found.step["push.k"] == pytest.approx(-1.5, rel=1e-6)


def test_what_was_noted_is_corrected_within_two_deviations():
    bench = straight({"noted.x": 5.0})
    (found,), _ = told(bench, "noted")
    assert found.step["noted.x"] == pytest.approx(0.2 + 2 * 0.03, rel=1e-6)


def test_the_best_of_the_shapes_scanned_counts_and_all_are_told_best_first():
    bench = straight({"bend.k": 3.0, "bend.onset": 0.7})
    (found,), scales = told(bench, "bend")
    left, ways = scales.cut.mean(bench.y - bench.predict(AT)), []
    for onset in (0.3, 0.7):
        c = scales.cut.mean(bench.column("bend.k", onset))[:, None]
        ways.append([promised(scales, left, c, USUAL.change, "bend", v) for v in (0.0, USUAL.shares["gain"] ** 2)])
    # all settings of one discrepancy are told, of that under which the best one comes to most
    under = max((0, 1), key=lambda i: max(way[i][0] for way in ways))
    assert [t[0] for t in found.settings] == pytest.approx(sorted((w[under][0] for w in ways), reverse=True), rel=1e-6)
    assert found.settings[0][2] == found.setting == {"bend.onset": 0.7}
    assert found.settings[1][2] == {"bend.onset": 0.3}
    assert found.settings[1][1]["bend.k"] == pytest.approx(ways[0][under][1][0], rel=1e-6)
    assert found.gain == found.settings[0][0]


def test_effects_are_told_best_first_and_without_any_there_is_nothing():
    bench = straight({"own.x": 0.3})
    found, _ = told(bench, "push", "own", "shift", "bend")
    assert sorted((s.gain for s in found), reverse=True) == [s.gain for s in found]
    assert {s.key for s in found} == {"push", "own", "shift", "bend"}
    assert found[0].key == "own"
    assert told(bench)[0] == []


@pytest.mark.parametrize("beyond", [np.inf, np.nan, 1e200])
def test_a_column_beyond_all_numbers_is_no_trial_and_takes_no_other_along(beyond):
    bench = straight({"own.x": 0.3})
    plain = {s.key: s.gain for s in told(bench, "bend", "own", "shift")[0]}
    usual, lost = bench.jacobian, [0.7]

    def jacobian(values, paths, recordings=None):
        out = usual(values, paths, recordings)
        out[:, [p == "bend.k" and values["bend.onset"] in lost for p in paths]] = beyond
        return out

    bench.jacobian = jacobian
    found = {s.key: s for s in told(bench, "bend", "own", "shift")[0]}
    assert {k: s.gain for k, s in found.items() if k != "bend"} == {k: g for k, g in plain.items() if k != "bend"}
    assert [t[2] for t in found["bend"].settings] == [{"bend.onset": 0.3}]
    lost.append(0.3)
    assert {s.key: s.gain for s in told(bench, "bend", "own", "shift")[0]} == {k: plain[k] for k in ("own", "shift")}


def test_what_an_effect_that_does_nothing_promises_is_its_prior_alone():
    bench = straight({})
    bench.candidates["own"] = replace(bench.candidates["own"], amplitudes=("idle.x",))
    bench.free = bench.free | {"idle.x": bench.free["own.x"]}
    bench.start = bench.start | {"idle.x": 0.0}
    usual = bench.column
    bench.column = lambda path, onset: np.zeros(len(bench.y)) if path == "idle.x" else usual(path, onset)
    (found,), _ = told(bench, "own")
    assert found.gain == pytest.approx(math.log(1 / 3))
    assert found.step == {"idle.x": 0.0}


class Gapped(Straight):
    """The first 40 x of a line is lost in a gap."""

    def column(self, path, onset):
        return -40.0 * (DRIVE > 0) if path == "gap.g" else super().column(path, onset)

    def predict(self, values, recordings=None):
        gap = dict(values).get("gap.g", 0.0)
        return super().predict({**values, "gap.g": 0.0}) - 40 * np.minimum(DRIVE, gap)


def gapped(corners: tuple[float, ...]) -> Gapped:
    """A gap of 0.2."""
    plain = straight({})
    candidates = {"gap": Candidate("gap", ("gap.g",), corners={"gap.g": corners} if corners else {}, rig=True)}
    free, start = {**plain.free, "gap.g": Free(0.0, 1.0, 0.1)}, {**plain.start, "gap.g": 0.0}
    left = {f.name: getattr(plain, f.name) for f in fields(plain)}
    return Gapped(**left | {"candidates": candidates, "free": free, "start": start, "y": plain.y - whole(0.2)})


def whole(gap: float) -> np.ndarray:
    return 40 * np.minimum(DRIVE, gap)


def test_what_moves_a_corner_is_scored_by_what_it_does_as_a_whole():
    """By its slope at nothing a gap lowers a line by the same everywhere, by what it does where it ends. Of the size
    that is right the promise is what the misfit loses, less the price of a line."""
    (found,), scales = told(gapped((0.05, 0.2, 0.5)), "gap")
    c = scales.cut.mean(-whole(0.2) / 0.2)[:, None]
    left = scales.cut.mean(scales.bench.y - scales.bench.predict(AT))
    ways = [promised(scales, left, c, USUAL.rig, "gap", v) for v in (0.0, USUAL.shares["gain"] ** 2)]
    worth, step = max(ways, key=lambda way: way[0])
    assert found.gain == pytest.approx(worth, rel=1e-6)
    assert found.step["gap.g"] == pytest.approx(step[0], rel=1e-6)
    assert step[0] == pytest.approx(0.2, rel=0.01)
    (by_slope,), _ = told(gapped(()), "gap")
    assert by_slope.gain < 0.9 * worth
    assert by_slope.step["gap.g"] < 0.15

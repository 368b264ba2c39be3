"""What a cut leaves without a name: strokes through fresh tissue have each a place of their own in the body."""

import numpy as np
import pytest

from tests.cutting.records import record, sample, strokes
from tissuejax.diagnosis.cutting import CuttingBench
from tissuejax.diagnosis.cutting_discrepancy import cutting_discrepancy
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.blocks import blocks
from tissuejax.energies.neo_hookean import NeoHookean

NOISE, DEPTH = 0.001, 0.008


def made(toughness, drift=lambda name, t: 0.0 * t):
    """Three strokes there and half the way back, without friction: toughness(name, x) where tissue is parted, and a
    layer that takes 1 N/m and gives it back; both set in over 0.3 mm."""
    rng, out = np.random.default_rng(5), []
    for name, speed in (("slow", 2e-3), ("middle", 5e-3), ("quick", 2e-2)):
        time, x = strokes(-0.003, 0.028, 0.014, speed=speed, rate=160 * speed / 0.031)
        setting_in = 1 - np.exp(-np.clip(x, 0, None) / 3e-4)
        parting = (1.0 + np.where(np.diff(x, prepend=x[0] - 1e-6) > 0, toughness(name, x), 0.0)) * setting_in
        force = DEPTH * parting + drift(name, time) + NOISE * rng.standard_normal(len(x))
        out.append(record(name, time, x, force, depth=DEPTH, noise=NOISE))
    return sample(*out)


def named(made):
    found = diagnose(made, "neo-hookean").as_dict()
    return found["verdict"], {e["name"] for e in found["effects"]}


def test_what_is_smooth_in_place_belongs_to_one_stroke_and_to_its_way_through_fresh_tissue():
    bench = CuttingBench.of(made(lambda name, x: 20.0 + 0 * x), NeoHookean(), ("slow", "middle", "quick"), ())
    cut = blocks(bench)
    parts = cutting_discrepancy(bench, cut, bench.fresh, bench.bevels).about(np.ones(len(cut.starts)))
    place = next(p for p in parts if p.name == "place").factor
    covariance = place @ place.T
    fresh = cut.mean(np.concatenate([bench.fresh[s.recording] for s in bench.segments]))
    assert np.abs(covariance[fresh == 0]).max() == 0
    assert np.diag(covariance)[fresh == 1] == pytest.approx(1.0, abs=1e-3)
    apart = cut.owner[:, None] != cut.owner
    assert np.abs(covariance[apart]).max() == 0
    assert {p.family for p in parts} == {"law", "gain", "onset", "peak", "slow", "white"}
    entry = next(p for p in parts if p.name == "peak").factor
    x = cut.mean(np.concatenate([np.asarray(s.drive) for s in bench.segments]))
    assert np.abs(entry[x > 3 * max(bench.bevels.values())]).max() < 1e-3  # over within a bevel
    assert (np.count_nonzero(entry, axis=1) <= 1).all()  # of one stroke each


@pytest.mark.slow
def test_a_map_of_each_strokes_own_has_its_name():
    draw = np.random.default_rng(1).standard_normal
    knots = {n: 1 + 0.25 * draw(7) for n in ("slow", "middle", "quick")}
    verdict, names = named(made(lambda n, x: 20 * np.interp(x, np.linspace(0, 0.03, 7), knots[n])))
    assert names == {"toughness-map"}
    assert verdict.startswith("found")


@pytest.mark.slow
def test_a_zero_that_drifts_otherwise_in_each_stroke_is_a_drift():
    ends = {"slow": 0.012, "middle": -0.015, "quick": 0.010}
    _, names = named(made(lambda n, x: 20.0 + 0 * x, lambda n, t: ends[n] * (0.5 + t / t[-1])))
    assert names == {"cutting-drift"}


@pytest.mark.slow
def test_nothing_is_named_where_toughness_is_one_number():
    assert named(made(lambda n, x: 20.0 + 0 * x)) == ("nothing-missing", set())

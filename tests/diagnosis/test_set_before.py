"""What was set before a recording began: where its strain counts from, and by whose clock its force is read."""

from dataclasses import replace

import numpy as np
import pytest

import tissuejax as tj
from tissuejax.diagnosis.diagnose import asked_of
from tissuejax.diagnosis.judgement.blocks import blocks, series
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.scales import BEFORE, scaled
from tissuejax.diagnosis.judgement.weigh import Start, weigh
from tissuejax.diagnosis.material import MaterialBench, strain_states
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.estimation.discrepancy import Part, Series, discrepancy, loading_states
from tissuejax.recordings.recording import Channel, Recording, Sample

STRAIN = np.linspace(0.0, 0.3, 31)


def two(paced: bool = True, at_once: bool = True) -> tuple[Part, ...]:
    """Parts of two series, sampled every 0.1 and every 0.4 s, of stresses of 50 x + 200 x^3 and 100 x at a strain x."""
    one = Series("a", "pull", 0.1 * np.arange(31.0), STRAIN[:, None], loading_states(STRAIN), 1.0, sampled=0.1)
    other = replace(one, recording="b", time=0.4 * np.arange(31.0), sampled=0.4)
    of = discrepancy([one, other], np.ones(62), paced=paced, at_once=at_once)
    return of.about(np.concatenate([50 * STRAIN + 200 * STRAIN**3, 100 * STRAIN]))


def named(parts: tuple[Part, ...], name: str) -> np.ndarray:
    (part,) = (p for p in parts if p.name == name)
    assert part.factor is not None
    return part.factor


def test_a_zero_moves_the_stress_by_its_slope_in_strain():
    """d/dx (50 x + 200 x^3) and d/dx 100 x, over a range of 0.3, of each series by itself."""
    own = np.column_stack([np.append(50 + 600 * STRAIN**2, np.zeros(31)), np.repeat([0.0, 100.0], 31)])
    assert named(two(), "zero") == pytest.approx(0.3 * own, rel=1e-9)


def test_a_clock_moves_the_stress_by_what_it_changes_from_one_sample_to_the_next():
    """Central differences of the samples, one-sided at the ends; the time between samples cancels."""
    steps = np.column_stack([np.gradient(50 * STRAIN + 200 * STRAIN**3), np.zeros(31)])
    assert named(two(), "clock")[:31] == pytest.approx(steps, rel=1e-9)
    assert named(two(), "clock")[31:, 1] == pytest.approx(np.full(31, 1.0), rel=1e-9)


def test_a_clock_is_a_part_where_time_is_more_than_strain_and_neither_is_where_it_is_not_asked_for():
    assert {p.name for p in two()} >= set(BEFORE)
    assert {p.name for p in two(paced=False)} & set(BEFORE) == {"zero"}
    assert not {p.name for p in two(at_once=False)} & set(BEFORE)


def test_neither_is_ever_wider_without_a_name():
    assert set(BEFORE) <= Criteria().settled
    assert {f: Criteria().shares[f] for f in BEFORE} == {"zero": 0.005, "clock": 1.0}


def pulled(zeros: tuple[float, ...], gap: float = 0.0) -> Sample:
    """Neo-Hookean blocks pulled by 30 %, each from a zero of its own, through a gap that all have."""
    noise, recordings = np.random.default_rng(3), {}
    strain, time = np.linspace(0.0, 0.3, 90), np.arange(90.0)
    for k, zero in enumerate(zeros):
        felt = 1 + np.maximum(strain - zero - gap, 0.0 if gap else -1.0)
        stress = 4000 * (felt - felt**-2) + noise.normal(0, 5, 90)
        seen = Channel(time, stress, "Pa", 5.0)
        recordings[f"s{k}"] = Recording(
            f"s{k}", "uniaxial", {"time": time, "stretch": 1 + strain}, {"nominal_stress": seen}
        )
    return Sample("pulled", recordings)


def test_a_zero_that_a_fault_of_the_set_can_move_is_that_faults():
    """One zero for all is a gap: across its slope nothing is left of the sum of the columns, and all of what
    recordings differ by."""
    sample = pulled((0.0, 0.0))
    bench = MaterialBench.of(sample, NeoHookean(), ("s0", "s1"), (), {"s0": 5.0, "s1": 5.0})
    cut = blocks(bench)
    of = discrepancy(series(bench, cut, strain_states(bench)), cut.spread(bench.sigma), at_once=True)
    scales = scaled(bench, cut, of, bench.y, {p: bench.start[p] for p in bench.base})
    before = named(scales.about(bench.y, bench), "zero")
    alike = np.sum(before, axis=1, keepdims=True)
    across = named(scales.about(bench.y, bench, faults=alike), "zero")
    assert np.sum(across, axis=1) == pytest.approx(np.zeros(len(alike)), abs=1e-9 * np.max(before))
    apart = before[:, 0] - before[:, 1]
    assert across[:, 0] - across[:, 1] == pytest.approx(apart, rel=1e-2, abs=1e-2 * np.max(apart))


def test_beside_a_gap_zeros_lie_across_the_gap_and_not_across_the_modulus():
    """The modulus is no fault of a rig. A common zero has the slope -d/dl mu (l - l^-2), hardly that of the modulus."""
    bench = asked_of(pulled((0.0, 0.0), gap=0.02), "neo-hookean", effects=("slack",)).whole
    cut = blocks(bench)
    of = discrepancy(series(bench, cut, strain_states(bench)), cut.spread(bench.sigma), at_once=True)
    scales = scaled(bench, cut, of, bench.y, {p: bench.start[p] for p in bench.base})
    weighed = weigh(scales, ("slack",), Start(dict(bench.start)), Criteria())
    zeros, values = named(weighed.parts, "zero"), weighed.refit.values
    gap, modulus = cut.mean(bench.jacobian(values, ["effects.slack.gap", "energy.mu"], bench.fitted)).T
    across = np.linalg.norm(zeros.T @ gap) / np.linalg.norm(gap)
    along = np.linalg.norm(zeros.T @ modulus) / np.linalg.norm(modulus)
    assert across < 1e-9 * along


def names(found: Diagnosis) -> list[str]:
    return [e["name"] for e in found.as_dict()["effects"]]


@pytest.mark.slow
def test_zeros_that_differ_by_some_thousandths_of_strain_are_nothing_and_a_gap_is_slack():
    """Half a per cent of the range, and 2 % of strain: at so little noise (0.2 % of the peak) a gap shows by where it
    ends, and its slope at nothing ends elsewhere."""
    assert names(tj.diagnose(pulled((0.0015, 0.0003, -0.0014)), "neo-hookean")) == []
    found = tj.diagnose(pulled((0.0006, -0.0004, 0.0002), gap=0.02), "neo-hookean")
    assert names(found) == ["slack"]
    assert found.answered.chosen.values["effects.slack.gap"] == pytest.approx(0.02, abs=0.001)


def swung(late: float) -> Sample:
    """Neo-Hookean blocks pulled along sines of 4 and 2 s, sampled every 0.04 s, whose force is `late` samples behind
    their stretch; noise of a hundredth of the peak."""
    noise, recordings = np.random.default_rng(5), {}
    time = np.arange(0.0, 8.0, 0.04)
    for k, period in enumerate((4.0, 2.0, 4.0)):

        def stretch(t: np.ndarray, period: float = period) -> np.ndarray:
            return 1.15 - 0.1 * np.cos(2 * np.pi * t / period)

        felt = stretch(time - 0.04 * late)
        stress = 4000 * (felt - felt**-2) + noise.normal(0, 25.0, len(time))
        inputs = {"time": time, "stretch": stretch(time)}
        recordings[f"s{k}"] = Recording(
            f"s{k}", "uniaxial", inputs, {"nominal_stress": Channel(time, stress, "Pa", 25.0)}
        )
    return Sample("swung", recordings)


@pytest.mark.slow
@pytest.mark.parametrize(("late", "named"), [(0.7, []), (3.0, ["clock-lag"])])
def test_a_force_that_is_less_than_a_sample_late_is_nothing_and_three_samples_late_a_lag(late, named):
    assert names(tj.diagnose(swung(late), "neo-hookean")) == named

"""A search's bench of pieces in place of samples: against closed forms and against the bench of all samples."""

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import asked_of
from tissuejax.diagnosis.judgement.blocks import blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import based, rooted
from tissuejax.diagnosis.judgement.weigh import Start, weigh
from tissuejax.diagnosis.thinned import FAR, thinned
from tissuejax.recordings.recording import Channel, Recording, Sample

MODULUS, SHARE, TAU, NOISE = 3000.0, 0.4, 2.0, 4.0  # Pa, 1, s, Pa


def neo_hookean(mu: float, stretch: np.ndarray) -> np.ndarray:
    """Nominal stress of uniaxial extension, incompressible."""
    return mu * (stretch - stretch**-2)


def relaxed(time: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """A standard solid: the share SHARE of every step of PK2 dies with TAU; by the midpoint of every step."""
    memory = np.zeros_like(stress)
    for i, (dt, step) in enumerate(zip(np.diff(time), np.diff(stress), strict=True)):
        memory[i + 1] = memory[i] * np.exp(-dt / TAU) + SHARE * step * np.exp(-0.5 * dt / TAU)
    return (1 - SHARE) * stress + memory


def pulled(time: np.ndarray, stretch: np.ndarray, stress: np.ndarray, seed: int) -> Recording:
    noisy = stress + NOISE * np.random.default_rng(seed).standard_normal(len(time))
    channels = {"nominal_stress": Channel(time, noisy, "Pa", NOISE)}
    return Recording(f"r{seed}", "uniaxial", {"time": time, "stretch": stretch}, channels)


def specimen(relaxing: bool = False, n: int = 900) -> Sample:
    recordings = []
    for seed, (top, up, end) in enumerate([(1.3, 4.0, 30.0), (1.2, 1.0, 20.0), (0.85, 2.0, 25.0)]):
        time = np.linspace(0.0, end, n)
        stretch = np.interp(time, [0, up, 0.7 * end, 0.7 * end + up, end], [1, top, top, 1.02, 1.02])
        stress = neo_hookean(MODULUS, stretch)
        if relaxing:  # S = P / stretch
            stress = stretch * relaxed(time, stress / stretch)
        recordings.append(pulled(time, stretch, stress, seed))
    return Sample("specimen", {r.name: r for r in recordings})


def benches(sample: Sample, effects: list[str], energy: str = "neo-hookean"):
    asked = asked_of(sample, energy, effects=effects)
    cut, of = asked.left()
    return asked.whole, asked.searched(cut), cut, of


def test_it_is_exact_where_it_is_anchored_and_near_elsewhere():
    """A neo-Hookean specimen pulled and held. Within a piece the stress is straight but for its curvature, of which a
    mean is off by P'' w^2 / 24, w the stretch that it covers."""
    whole, thin, cut, _ = benches(specimen(), ["drift"])
    assert sum(len(t.time) for t in thin._tests.values()) < 0.4 * sum(len(t.time) for t in whole._tests.values())
    stretch = np.concatenate([s.drive for s in whole.segments])
    (path,) = whole.base
    truth = neo_hookean(MODULUS, stretch)
    lacking = cut.mean(thin.predict({path: MODULUS}) - truth)
    curvature = 6 * MODULUS * 0.85**-4  # the largest, of -mu stretch^-2
    assert 0 < np.max(np.abs(lacking)) < curvature * (FAR * 0.3) ** 2 / 24
    near = thin.anchored({path: MODULUS})
    np.testing.assert_allclose(near.predict({path: MODULUS}), truth, atol=1e-8 * MODULUS)
    # elsewhere a hundredth of what was lacking: the modulus is a hundredth off
    moved = cut.mean(near.predict({path: 1.01 * MODULUS}) - neo_hookean(1.01 * MODULUS, stretch))
    np.testing.assert_allclose(moved, 0.01 * lacking, atol=1e-6 * MODULUS)
    slope = cut.mean(near.jacobian({path: MODULUS}, (path,)))[:, 0]
    np.testing.assert_allclose(slope, cut.mean(neo_hookean(1.0, stretch)), atol=1e-3)


def test_a_hum_is_predicted_in_full():
    """It turns within a piece, so pieces would make another, slow one of it."""
    whole, thin, _, _ = benches(specimen(), ["periodic", "drift"])
    hum = whole.candidates["periodic"]
    values = {p: 11.3 if p.endswith("frequency") else 20.0 for p in hum.paths}
    np.testing.assert_array_equal(thin.predict(values), whole.predict(values))
    paths = (*whole.base, *values)
    np.testing.assert_array_equal(thin.jacobian(values, paths), whole.jacobian(values, paths))
    asked = [({}, whole.candidates["drift/offset"].amplitudes[0]), (values, hum.amplitudes[0])]
    both, all_samples = thin.columns({}, asked), whole.columns({}, asked)
    np.testing.assert_array_equal(both[:, 1], all_samples[:, 1])
    assert np.all(np.isfinite(both[:, 0]))


@pytest.mark.parametrize("cycles", [1, 20])
def test_no_piece_covers_more_than_a_small_part_of_the_way(cycles):
    """Many cycles are not taken for a few points: their pieces are more, or all samples are predicted."""
    time = np.linspace(0.0, 60.0, 6000)
    stretch = 1.1 - 0.1 * np.cos(2 * np.pi * cycles * time / 60.0)
    recordings = [pulled(time, stretch, neo_hookean(MODULUS, stretch), seed) for seed in (0, 1)]
    whole, thin, cut, _ = benches(Sample("cycled", {r.name: r for r in recordings}), ["drift"])
    assert thin is not whole
    counts = thin._counts["r0"]
    assert np.sum(counts) == 6000
    assert counts[0] == 1  # a history begins there
    ends = np.cumsum(counts)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(stretch)))])
    covered = way[ends - 1] - way[ends - counts]
    assert np.max(covered) < 2 * FAR * 0.2 + np.max(np.abs(np.diff(stretch)))
    # every piece lies in one block
    assert set(cut.starts[cut.owner == 0]) <= {0, *ends}


def test_a_short_recording_is_predicted_in_full():
    whole, thin, _, _ = benches(specimen(n=150), ["drift"])
    assert thin is whole
    assert thinned(whole, blocks(whole)) is whole


def test_evidence_is_that_of_all_samples():
    """A relaxing specimen weighed by pieces and by all samples: the same evidence to what a search settles at."""
    whole, thin, cut, of = benches(specimen(relaxing=True), ["viscoelasticity", "drift"])
    found = {}
    for name, bench in (("whole", whole), ("thin", thin)):
        scales, base = based(bench, cut, of, Criteria(), Kept())
        rooted(scales, base, whole.free)
        for key in ("viscoelasticity/one time", "drift/offset"):
            start = {**base.refit.values, **scales.bench.candidates[key].grid[0]}
            w = weigh(scales, (key,), Start(start), Criteria(), Course())
            found[name, key] = w.evidence.log_evidence
            if name == "thin":
                exact = whole.predict(w.refit.values)
                np.testing.assert_allclose(w.refit.prediction, exact, atol=1e-8 * MODULUS)
                if key.startswith("visco"):
                    g = w.refit.values["effects.viscoelasticity.g1"]
                    assert g == pytest.approx(SHARE, abs=0.02)
        found[name, ()] = base.evidence.log_evidence
    settled = Course().settled
    for key in ("viscoelasticity/one time", "drift/offset", ()):
        assert found["thin", key] == pytest.approx(found["whole", key], abs=3 * settled), key

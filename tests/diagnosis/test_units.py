"""Evidence does not depend on how stiff a specimen is: the same recordings, all stresses a thousand times as large."""

import math

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import asked_of
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.evidence import SetEvidence
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import Setup, alone, based
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, SHARES, TIMES, NOISE = 1000.0, (0.3, 0.25), (0.6, 9.0), 0.004  # Pa, 1, s, of the largest stress
LAW, STIFFER = "reduced-polynomial-2", 1e6
CLOSE, FAR = 0.1, 2.5  # nats: what most sets differ by at most, and what any may, where descents end apart
# of relaxation that load quickens, which ends here where load quickens nothing, the rest has several optima
SEVERAL = frozenset({"viscoelasticity/load-dependent"})
EFFECTS = ("viscoelasticity", "softening", "energy-form", "drift")


def relaxing(time: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Nominal stress of a neo-Hookean specimen whose PK2 stress relaxes with two times, over its shear modulus; each
    memory integrated for a stress that is linear between samples."""
    pk2 = 1 - stretch**-3
    lost = np.zeros(len(time))
    for share, tau in zip(SHARES, TIMES, strict=True):
        h = 0.0
        for k in range(1, len(time)):
            dt, ds = time[k] - time[k - 1], pk2[k] - pk2[k - 1]
            h = h * math.exp(-dt / tau) + ds * tau / dt * -math.expm1(-dt / tau)
            lost[k] += share * (pk2[k] - h)
    return stretch * (pk2 - lost)


def pulled(stiffer: float) -> Sample:
    """One specimen, pulled and held, and pulled and let go; its stress and its noise times `stiffer`."""
    rng, made = np.random.default_rng(3), {}
    for name, times, stretches in (
        ("held", [0, 1, 40], [1, 1.15, 1.15]),
        ("cycled", [0, 4, 8, 14, 20], [1, 1.1, 1, 1.15, 1]),
    ):
        time = np.linspace(0, times[-1], 120)
        stretch = np.interp(time, times, stretches)
        stress = MU * relaxing(time, stretch)
        noise = NOISE * np.max(np.abs(stress))
        values = stiffer * (stress + noise * rng.standard_normal(len(time)))
        channel = Channel(time, values, "Pa", float(stiffer * noise))
        made[name] = Recording(name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, {})
    return Sample("pulled", made)


def weighed(stiffer: float) -> dict[frozenset[str], SetEvidence]:
    asked = asked_of(pulled(stiffer), LAW, effects=EFFECTS)
    cut, of = asked.left()
    criteria, effort = Criteria(), Effort(most=1, given_up=math.inf)
    scales, base = based(asked.whole, cut, of, criteria, Kept())
    found = alone(scales.bench, scales, base, Setup(criteria, effort))
    found.reshape(frozenset({"softening"}))
    return {key: w.evidence for key, w in found.weighed.items()}


@pytest.mark.slow
def test_a_stiffer_specimen_has_the_same_evidence():
    soft, stiff = weighed(1.0), weighed(STIFFER)
    none = frozenset()  # its moduli have flat priors, a density per pascal
    assert stiff[none].log_evidence == pytest.approx(
        soft[none].log_evidence - (soft[none].n - soft[none].k) * math.log(STIFFER), abs=0.5
    )
    assert {name for e in soft.values() for name in e.names} == set(EFFECTS)
    apart = {
        key: abs(soft[key].log_evidence - soft[none].log_evidence - stiff[key].log_evidence + stiff[none].log_evidence)
        for key in (soft.keys() & stiff.keys()) - {SEVERAL}
    }
    assert np.median([*apart.values()]) < CLOSE
    assert max(apart.values()) < FAR, apart
    # three forms of relaxation lie within half a nat of one another, less than rounding moves one of them
    best = {max(sets, key=lambda k: sets[k].log_evidence) for sets in (soft, stiff)}
    assert {name for key in best for name in soft[key].names} == {"viscoelasticity"}

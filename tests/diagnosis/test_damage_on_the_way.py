"""Damage that sets in on the virgin path is unlike damage that shows on the way back: its form is tried."""

import numpy as np

from tissuejax.diagnosis.diagnose import asked_of
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import Setup, alone, based
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, LOST, ENERGY, NOISE = 1000.0, 0.45, 60.0, 15.0  # Pa, 1, J/m3, Pa


def damaged(stretch: np.ndarray) -> np.ndarray:
    """Nominal stress of a neo-Hookean specimen that has lost a share of its stiffness by the largest energy it has
    borne: P = (1 - d) P_0, d = LOST (1 - exp(-max W / ENERGY)) (Simo 1987, Comput. Methods Appl. Mech. Eng. 60)."""
    energy = 0.5 * MU * (stretch**2 + 2 / stretch - 3)
    lost = LOST * -np.expm1(-np.maximum.accumulate(energy) / ENERGY)
    return (1 - lost) * MU * (stretch - stretch**-2)


def pulled() -> Sample:
    """Pulled and let go twice, to different stretches."""
    rng, made = np.random.default_rng(1), {}
    for name, half, top in (("less", 4.0, 1.2), ("more", 8.0, 1.4)):
        time = np.linspace(0, 2 * half, 160)
        stretch = np.interp(time, [0, half, 2 * half], [1, top, 1])
        stress = damaged(stretch) + NOISE * rng.standard_normal(len(time))
        channel = Channel(time, stress, "Pa", NOISE)
        made[name] = Recording(name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, {})
    return Sample("pulled", made)


def test_damage_on_the_virgin_path_is_tried_though_damage_behind_it_says_nothing():
    """Softening that begins where a path turns round leaves it as it was, and was the only one that was scored: what
    was lost on the way was called relaxation."""
    asked = asked_of(pulled(), "neo-hookean", effects=("softening", "viscoelasticity"))
    cut, of = asked.left()
    criteria, effort = Criteria(), Effort()
    scales, base = based(asked.whole, cut, of, criteria, Kept())
    found = alone(scales.bench, scales, base, Setup(criteria, effort))
    assert found.best == {"softening/with loading"}
    relaxing = [k for k in found.weighed if found.names(k) == {"viscoelasticity"}]
    assert found.worth(found.best) > max(map(found.worth, relaxing)) + 3

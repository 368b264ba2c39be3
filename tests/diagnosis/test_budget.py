"""A search that has spent what it may says so."""

import numpy as np

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.recordings.recording import Channel, Recording, Sample


def sample(offset: float = 30.0) -> Sample:
    """Three pulls on a neo-Hookean specimen of 500 Pa that stiffens from one to the next, with a wrong zero."""
    rng, made, time = np.random.default_rng(3), {}, np.arange(60) * 0.1
    stretch = 1 + 0.2 * np.sin(np.pi * np.arange(60) / 59)
    for i, name in enumerate(("r1", "r2", "r3")):
        y = (1 + 0.1 * i) * 1000 * (stretch - stretch**-2) + offset + 2 * rng.standard_normal(60)
        channel = Channel(time, y, "Pa", 2.0)
        made[name] = Recording(
            name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, {"start": 100.0 * i}
        )
    return Sample("s", made)


def test_a_search_ends_when_its_budget_is_spent_and_says_so():
    found = diagnose(sample(), energy="neo-hookean", effects=("drift", "aging"), effort=Effort(most=2, spend=1.0))
    assert any("was spent" in w for w in found.as_dict()["warnings"])
    assert found.as_dict()["effects"] == []

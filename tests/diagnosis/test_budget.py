"""A search that has spent what it may says so; each search of a diagnosis may spend that, and all of it counts."""

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import asked_of, diagnose
from tissuejax.diagnosis.judgement import search
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


@pytest.mark.slow
def test_every_search_may_spend_as_much_as_the_first(monkeypatch):
    """Where noise is read again all sets are weighed anew, and what was weighed before is not in the answer."""
    ends = []

    def again(e):
        ends.append(e)
        return e.scales.blocked

    monkeypatch.setattr(search, "noise_beside", again)
    asked = asked_of(sample(), "neo-hookean", effects=("drift", "aging"))
    cut, of = asked.left()
    cost = search.explore(asked.searched(cut), cut, of, search.Setup(effort=Effort(readings=0))).bench.spent
    last = search.explore(asked.searched(cut), cut, of, search.Setup(effort=Effort(spend=1.1 * cost)))
    assert len(ends) == 2
    assert all(e.weighed.keys() == last.weighed.keys() and not e.exhausted for e in (*ends, last))


def test_what_benches_made_from_one_spend_counts():
    asked = asked_of(sample(), "neo-hookean", effects=("drift", "aging"))
    bench = asked.searched(asked.left()[0])
    near, before = bench.anchored(bench.start), bench.spent
    near.predict({p: bench.start[p] for p in bench.base})
    assert bench.spent == before + len(bench.fitted)

"""Refits that were finished are found again for the same question, and for no other."""

import numpy as np
from spring_bench import spring

from tissuejax.cache import source
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.kept_refits import KeptRefits
from tissuejax.diagnosis.misfit import Misfit, white
from tissuejax.diagnosis.search import Budget
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


def test_what_was_kept_counts_only_for_the_same_question(tmp_path, monkeypatch):
    """Code, physics, data, noise level, noise model, start and options: each makes another refit."""

    def asked(told="physics", noise=None, start=None, change=None, **options) -> int:
        bench = spring({}, names=("r1", "r2"), held_out=())
        monkeypatch.setattr(bench, "told", lambda: told)
        if change:
            change(bench)
        misfit = white(bench) if noise is None else Misfit(bench, {(r, "force"): noise for r in ("r1", "r2")})
        kept = KeptRefits(bench, tmp_path)
        kept.refit(misfit, (), start or {}, **options)
        return kept.found

    def scaled(name):
        return lambda bench: setattr(bench, name, 1.1 * getattr(bench, name))

    assert asked() == 0
    assert asked() == 1
    assert asked(told="other physics") == 0
    assert asked(told=None) == 0
    assert asked(change=scaled("y")) == 0
    assert asked(change=scaled("sigma")) == 0
    assert asked(start={"a": 6.0}) == 0
    assert asked(iterations=4) == 0
    assert asked(seed=np.zeros((800, 2))) == 0
    assert asked(seed=np.full((800, 2), 1e-9)) == 0
    with monkeypatch.context() as edited:
        edited.setattr(source, "LOADED", "another formula")
        assert asked() == 0
    assert asked() == 1


def test_a_search_ends_when_its_budget_is_spent_and_says_so():
    found = diagnose(sample(), energy="neo-hookean", effects=("drift", "aging"), budget=Budget(most=2, spend=(1.0,)))
    assert any("was spent" in w for w in found.as_dict()["warnings"])
    assert found.as_dict()["effects"] == []

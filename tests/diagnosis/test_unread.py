"""A recording that stays unread changes nothing, and is predicted when all is done."""

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.errors import InputError
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.judged_sentences import sure

NOISE, OFFSET = 2.0, 40.0
QUICK = {"effects": ("drift", "slack"), "effort": Effort(most=1, reshaped=(0, 0, 0))}


def recorded(*names) -> Sample:
    """Pulls of 500 Pa neo-Hookean tissue in closed form, recorded 40 Pa too high."""
    made, time = {}, np.arange(80) * 0.1
    for name, far in (("pull", 1.25), ("push", 0.8), ("later", 1.3)):
        rng = np.random.default_rng(len(name))
        stretch = np.interp(time, [0, 1, 5, 8], [1, 1, far, 1])
        y = 1000 * (stretch - stretch**-2) + OFFSET + NOISE * rng.standard_normal(80)
        channel = Channel(time, y, "Pa", NOISE)
        made[name] = Recording(name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel})
    return Sample("s", {n: made[n] for n in names})


def test_what_is_unread_takes_no_part_and_is_predicted_to_its_noise():
    found = diagnose(recorded("pull", "push", "later"), "neo-hookean", unread="later", **QUICK)
    bare = diagnose(recorded("pull", "push"), "neo-hookean", **QUICK)
    assert found.verdict.chosen.values == bare.verdict.chosen.values
    assert found.verdict.confidence == bare.verdict.confidence
    assert found.verdict.judgement.names == ("drift",)
    own = found.as_dict()["unread"]["later"]
    assert own["n"] == 80
    assert own["noise"] == NOISE
    assert own["after"] == pytest.approx(NOISE, rel=0.25)
    assert own["before"] > 5 * NOISE
    assert any(s.startswith("later, which nothing has read until now") for s in sure(found))
    assert "unread" not in bare.as_dict()


def test_a_name_that_is_not_there_and_a_sample_without_any_left_are_refused():
    with pytest.raises(InputError, match="unknown recording 'latter'"):
        diagnose(recorded("pull", "later"), "neo-hookean", unread=["latter"])
    with pytest.raises(InputError, match="no recording is left to read"):
        diagnose(recorded("pull"), "neo-hookean", unread=["pull"])

"""Aimed probings: the size asked for is found, what misses it is drawn again, and keys say what was aimed at."""

import numpy as np
import pytest

from tissuejax.challenge import probing_aims, probing_cases
from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.probing_aims import AIMS, TURNS, aim
from tissuejax.errors import NotConverged

C10 = 600.0


SLOPES = {"registration": 1e3, "drift": 300.0, "friction": 30.0, "energy-form": 1 / C10}


def linear(one: Ingredient) -> tuple[float, float]:
    """Sizes that grow with the amount, of a slipping base with its compliance: four times as large in the markers."""
    if one.name == "base-slip":
        return 1e5 / one.amount, 4e5 / one.amount
    return SLOPES[one.name] * one.amount, 0.0


@pytest.mark.parametrize("goal", AIMS, ids=lambda a: a.name)
def test_amounts_are_found_for_the_sizes_asked_for(rng, goal):
    found = []
    for _ in range(20):
        drawn = [c.ingredient(rng, C10) for c in goal.courses]
        assert tuple(d.name for d in drawn) == goal.effects
        made = [goal.sized(rng, d, C10, linear) for d in drawn]
        for one, before in zip(made, drawn):
            assert one.shape == before.shape
            assert goal.least <= goal.size(*linear(one)) <= goal.most
            found.append(goal.size(*linear(one)))
    assert max(found) / min(found) > 1.2  # sizes are spread over the range


def test_a_size_that_misses_its_aim_is_refused():
    slip, near = AIMS[0], AIMS[1]
    slip.check({"base-slip": (0.5, 2.0)})
    with pytest.raises(NotConverged, match="base-slip has 1.1 times"):
        slip.check({"base-slip": (1.1, 4.0)})  # the force shows it too
    with pytest.raises(NotConverged, match="0.4 in the markers"):
        slip.check({"base-slip": (0.5, 0.4)})  # nothing shows it
    near.check({"registration": (0.1, 1.2)})
    with pytest.raises(NotConverged):
        near.check({"registration": (0.6, 0.5)})
    with pytest.raises(NotConverged):
        AIMS[2].check({"energy-form": (5.0, 0.0), "friction": (2.0, 1.0)})


def test_aims_take_turns():
    assert [aim(i) for i in range(6)] == [AIMS[k] for k in TURNS]
    assert {aim(i) for i in range(6)} == set(AIMS)


def test_a_drawn_case_has_what_it_was_aimed_at(monkeypatch):
    """Registration near the noise, on a coarse mesh: what its key says of sizes and channels."""
    monkeypatch.setattr(probing_cases, "COARSE", (5, 5, 3))
    key = probing_cases.draw("p001", 3, 1, mesh=(5, 5, 3), aimed=True).key
    assert key["aim"] == "a registration near the noise"
    assert key["category"] == "one"
    assert key["effects"] == ["registration"]
    assert 0.7 <= key["size_over_noise"]["registration"] <= 1.5
    assert key["size_over_noise"]["registration"] == max(key["sizes_of_force_and_markers"]["registration"])
    low, high = probing_aims.TRIED["registration"]
    assert low <= key["ingredients"][0]["amount"] <= high
    squares = np.square([key["where"]["channel_sizes"][f"force {a}"] for a in "xyz"])
    assert np.sqrt(squares.mean()) == pytest.approx(key["sizes_of_force_and_markers"]["registration"][0])

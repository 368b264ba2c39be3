"""Records of probing cases: what only sensors feel is not solved for again."""

import numpy as np
import pytest

from tissuejax.challenge import probing_cases
from tissuejax.challenge.lobe import Lobe
from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.probe_paths import Path, over
from tissuejax.challenge.probing_bench import Record, Setup, Visit, record
from tissuejax.challenge.probing_menu import CATALOGUED, LOUD
from tissuejax.challenge.probing_sizes import parts
from tissuejax.challenge.solid import Tissue

LOBE = Lobe(0.03, 0.027, 0.09, 0.02, 0.5, 0.9, (0.0, 0.0))
RADIUS = 0.0095


@pytest.fixture(scope="module")
def told():
    """Function from effects to the record of one short press, and what has been solved so far."""
    top = over(LOBE, (0.0, 0.0), RADIUS)
    heights = np.array([top + 5e-4, top + 5e-4, top - 1.5e-3, top - 1.5e-3, top + 5e-4, top + 5e-4])
    path = Path(np.array([0.0, 0.4, 1.4, 2.4, 3.4, 3.8]), np.stack([0 * heights, 0 * heights, heights], 1))
    solved: dict = {}

    def of(*effects: Ingredient):
        places = [(0.3, 0.2), (-0.2, 0.4)]
        site = (0.0, 0.0)
        setup = Setup(LOBE, Tissue(600.0, 300.0, 2e4), [site], RADIUS, places, (5, 5, 3))
        return record(setup, Visit(0, path, (100.0, 400.0)), list(effects), solved)

    return of, solved


def test_sensors_and_rig_share_one_solution(told):
    of, solved = told
    plain = of()
    assert np.abs(plain.force[:, 2]).max() > 0.02
    assert len(solved) == 1
    drifting = of(Ingredient("drift", "", 0.01, {"mix": [1.0, 0.5]}))
    time = plain.force_time
    expected = 0.01 * (1 + 0.05 * time)[:, None] * [0.2, -0.1, 1.0]
    np.testing.assert_allclose(drifting.force - plain.force, expected, atol=1e-12)
    aged = of(Ingredient("aging", "", -0.2, {}))
    np.testing.assert_allclose(aged.force, plain.force * np.exp(-0.2 * (100 + time) / 400)[:, None], atol=1e-12)
    soft = of(Ingredient("machine-compliance", "", 2e-3, {}))
    deepest = np.argmin(plain.probe[:, 2])
    felt = np.interp(plain.time[deepest], time, plain.force[:, 2])
    assert plain.probe[deepest, 2] - soft.probe[deepest, 2] == pytest.approx(2e-3 * felt, rel=0.02)
    assert len(solved) == 1


@pytest.mark.parametrize("power", [1, 2])
def test_a_rig_that_gives_is_as_large_as_it_bends_the_force_along_the_path_recorded(power):
    """Force A d^n and a probe recorded c A d^n too deep: A (d + c A d^n)^n is what the bare body would have felt there,
    which is a factor for n = 1 and no effect at all."""
    A, c, t = 200.0**power / 4, 2e-3, np.linspace(0.0, 1.0, 201)
    deep = 5e-3 * np.sin(np.pi * t)

    def pressed(below: np.ndarray) -> Record:
        force = np.stack([0 * t, 0 * t, A * deep**power], 1)
        return Record("r", 0.0, RADIUS, t, np.stack([0 * t, 0 * t, -below], 1), t, force, t, np.zeros((201, 1, 3)))

    there, felt = A * (deep + c * A * deep**power) ** power, A * deep**power
    left = felt - there * (there @ felt) / (there @ there)
    size = max(parts([pressed(deep)], [pressed(deep + c * felt)], (1e-3, 1e-4)))
    assert size == pytest.approx(np.sqrt(np.mean(left**2) / 3) / 1e-3, rel=0.05, abs=0.01)
    assert (size > 0.5) == (power == 2)


def test_the_body_is_solved_for_again_where_it_feels_the_effect(told):
    of, solved = told
    plain, lower = of(), of(Ingredient("contact-offset", "", 3e-4, {"signs": [-1.0]}))
    assert len(solved) == 2
    assert lower.force[:, 2].max() > 1.1 * plain.force[:, 2].max()
    np.testing.assert_array_equal(lower.probe, plain.probe)


def test_a_strong_challenge_has_every_effect_once_and_the_stronger_draws(rng):
    kinds = [probing_cases.strong_category(i) for i in range(24)]
    assert sorted(turn for kind, turn in kinds if kind == "one") == list(range(16))
    assert sum(kind == "two" for kind, _ in kinds) == 8
    for course in CATALOGUED:
        weak, strong = (
            np.median([course.strength(course.ingredient(rng, 600.0, draws).amount) for _ in range(200)])
            for draws in (1, probing_cases.STRONG)
        )
        assert strong > weak, course.name


def test_pairs_that_can_be_seen_take_turns_and_never_mix_histories(rng):
    drawn = [probing_cases.courses(rng, "two", i, LOUD) for i in range(2 * len(LOUD))]
    assert [first.name for first, _ in drawn] == 2 * [c.name for c in LOUD]
    assert all(a.name != b.name and b in LOUD and not (a.history and b.history) for a, b in drawn)

"""The course of a search by hand: from single effects to triples, and the noise read again."""

from types import SimpleNamespace

import pytest

from tests.diagnosis.known_sets import explored, weighed
from tissuejax.diagnosis.judgement import search
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.estimation.correlation import GAIN


@pytest.mark.parametrize(
    ("gained", "kept", "costly", "white", "read"),
    [
        (GAIN / 2 + 0.1, "hum", False, False, True),
        (GAIN / 2 - 0.1, "hum", False, False, False),
        (GAIN / 2 + 0.1, "", False, False, False),
        (GAIN / 2 + 0.1, "hum", True, False, False),
        (GAIN / 2 + 0.1, "hum", False, True, False),
    ],
    ids=["likelier", "not by enough", "nothing found", "simulations", "white before and after"],
)
def test_noise_is_read_again_where_the_best_set_is_likelier_for_it(monkeypatch, gained, kept, costly, white, read):
    noise = SimpleNamespace(noise=None if white else "of the residual")
    monkeypatch.setattr(search, "shown", lambda *_: noise)
    e = explored({("hum",): -50.0 + gained}, costly=costly)
    e.scales.blocked = SimpleNamespace(noise=None)
    if kept:
        e.weighed[frozenset({kept})] = weighed((kept,), -50.0, mu=3.0)
    found = search.noise_beside(e)
    assert (found is noise) if read else found is None


class Course:
    """A search that writes down what it is asked for, with a best set of so many effects."""

    def __init__(self, best: int, strange: bool, parents: dict[int, list[str]], costly: bool = False):
        self.best, self.strange, self.told = frozenset(f"e{i}" for i in range(best)), strange, []
        self.parent_sets, self.bench = parents, SimpleNamespace(costly=costly)
        for name in ("extend", "reshape", "settle", "leave_out", "look_inside"):
            setattr(self, name, lambda *given, name=name: self.told.append((name, *given)))

    def parents(self, size):
        return self.parent_sets.get(size, [])

    def near(self, size, below=None):
        return [f"{size} near {below}", "another", "a third"]

    def log_worth(self, base):
        return base.worth

    def worth(self, key):
        return -50.0


def course(monkeypatch, found: Course, happened: float = -60.0, **effort) -> tuple[list, list]:
    """What a search is asked for, and beside which bases its singles are weighed."""
    bases, moment = [], SimpleNamespace(worth=happened)
    monkeypatch.setattr(search, "alone", lambda bench, scales, base, by: (bases.append(base), found)[1])
    monkeypatch.setattr(search, "disrupted", lambda scales, base, *more: (scales, moment))
    search.searched(found.bench, None, "base", search.Setup(effort=Effort(**effort)))
    return found.told, ["what happened" if b is moment else b for b in bases]


def test_pairs_and_triples_are_grown_shaped_and_looked_into(monkeypatch):
    parents = {1: list("abcd"), 2: list("efg")}
    told, _ = course(monkeypatch, Course(2, False, parents))
    of_pairs = [("extend", list("abc"), 10, 5), ("reshape", "2 near None"), ("settle", 2)]
    of_pairs += [("leave_out", frozenset({"e0", "e1"}))]
    of_pairs += [("look_inside", k) for k in ("2 near 20.0", "another", "a third")] + [("settle", 1)]
    of_triples = [("extend", list("ef"), 6, 5), ("settle", 3), ("leave_out", frozenset({"e0", "e1"}))]
    of_triples += [("look_inside", k) for k in ("3 near 20.0", "another", "a third")] + [("settle", 2)]
    assert told == of_pairs + of_triples


@pytest.mark.parametrize(
    ("best", "strange", "parents", "effort", "sizes"),
    [
        (1, False, (1, 2), {}, [10]),
        (1, True, (1, 2), {}, [10, 6]),
        (2, False, (1, 2), {"most": 2}, [10]),
        (2, False, (1, 2), {"most": 1}, []),
        (2, False, (1,), {}, [10]),
        (2, False, (), {}, []),
        (0, True, (1, 2), {"stepwise": True}, []),
        (1, True, (1, 2), {"stepwise": True}, [10]),
        (2, False, (1, 2), {"stepwise": True}, [10, 6]),
    ],
    ids=["no second", "strange", "two", "one", "no pair", "nothing", "no step", "one step", "both steps"],
)
def test_a_third_effect_is_sought_where_a_second_came_in_or_much_is_left(
    monkeypatch, best, strange, parents, effort, sizes
):
    told, _ = course(monkeypatch, Course(best, strange, {k: ["a"] for k in parents}), **effort)
    assert [most for name, *given in told if name == "extend" for most in given[1:2]] == sizes


@pytest.mark.parametrize(("happened", "beside"), [(-49.0, ["base", "what happened"]), (-51.0, ["base"])])
def test_what_happened_at_once_comes_in_first_where_it_is_likelier_than_any_effect(monkeypatch, happened, beside):
    assert course(monkeypatch, Course(1, False, {}), happened)[1] == beside


@pytest.mark.parametrize(("costly", "left_out"), [(True, 1), (False, 0)])
def test_simulations_begin_the_base_again_from_the_best_effect(monkeypatch, costly, left_out):
    told, _ = course(monkeypatch, Course(1, False, {}, costly))
    assert [name for name, *_ in told] == ["leave_out"] * left_out

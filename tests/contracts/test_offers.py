"""What every effect says of itself to a diagnosis, for every kind of recordings: forms, shapes, ranges."""

import numpy as np
import pytest

from tissuejax.diagnosis.catalogue import Entry, entries, linked
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.offered import Protocol
from tissuejax.diagnosis.probing_runs import TOGETHER
from tissuejax.effects.catalogue import effects
from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Probed, Sizes
from tissuejax.energies.catalogue import energy
from tissuejax.model import Model

SIZES = Sizes(energy=120.0, strain=0.3, force=0.8, session=600.0, recording=40.0, step=0.05)
PROBED = Probed(modulus=900.0, height=0.02, session=400.0)
ASKED = {
    "homogeneous": lambda kind: kind.in_material_tests(SIZES),
    "probing": lambda kind: kind.in_probings(PROBED),
    "cutting": lambda kind: kind.in_cuts(),
}
OFFERS = {(kind, n): ask(effect) for kind, ask in ASKED.items() for n, effect in effects(kind).items()}


def called(key: tuple[str, str]) -> list:
    """All offers that are reported under one name."""
    title = {k: o.title or o.effect.name for k, o in OFFERS.items()}
    return [o for k, o in OFFERS.items() if k[0] == key[0] and title[k] == title[key]]


@pytest.mark.parametrize("key", OFFERS, ids="/".join)
def test_an_offer_speaks_of_the_effect_s_own_parameters(key):
    offer = OFFERS[key]
    declared = {p.name: p for p in offer.effect.parameters}
    assert len({f.name for f in offer.forms}) == len(offer.forms)
    for form in offer.forms:
        assert set(form.free) <= set(declared)
        neutral = bool(set(form.free) & set(offer.effect.amplitudes))
        assert neutral != bool(form.widens), "a form without an amplitude can't be neutral"
        assert not (form.widens and form.free), "a form that widens the discrepancy has no parameters"
        assert set(form.lacking) <= set(Protocol.__annotations__), "no property of a protocol"
        assert {*form.widens, *(f for more in form.lacking.values() for f in more)} <= set(Criteria().shares)
        assert set(form.grid) <= set(form.free)
        assert {*form.each, *form.most} <= set(form.free)
        for name, values in form.grid.items():
            assert all(declared[name].lower <= v <= declared[name].upper for v in values)
        assert set(form.beside) <= {f.name for o in called(key) for f in o.forms}
    assert {*offer.scales, *offer.priors, *offer.ranges} <= set(declared)
    assert any(f.nominated for f in offer.forms) or offer.title


@pytest.mark.parametrize("key", OFFERS, ids="/".join)
def test_what_is_declared_begins_at_neutral_and_inside_its_range(key):
    entry = Entry.of(OFFERS[key])
    model = Model(energy("neo-hookean"), None, (entry.effect,)).across(("r1", "r2"))
    free, start, candidates = entry.declare(model, ("r1",), ("r2",))
    assert candidates
    for c in candidates:
        assert bool(c.amplitudes) != bool(c.widens)
        assert all(start[p] == 0 for p in c.amplitudes)
        assert set(c.paths) <= set(free)
    for path, f in free.items():
        assert f.lower < f.upper
        assert f.lower <= start[path] <= f.upper, path


@pytest.mark.parametrize("name", effects())
def test_what_an_effect_says_of_itself_is_what_it_does(name):
    kind = effects()[name]
    past = kind.memory is not Effect.memory
    assert kind.history == (past and not kind.searches), "a past that is no search is a program of its own"
    assert kind.group in ("", *TOGETHER)
    if "probing" in kind.kinds:
        declared = {p.name for p in kind.in_probings(PROBED).effect.parameters}
        assert set(kind.displaces) <= declared
        assert not kind.displaces or not kind.remembers
    if kind.added:
        assert kind.stress is not Effect.stress or kind.channels is not Effect.channels


def test_ranges_and_priors_follow_from_the_recordings():
    """2.5 periods in 40 s to a quarter of the sampling rate; ageing by half in the session; a base that gives
    way by a fifth of what the tissue over it does."""
    assert OFFERS["homogeneous", "periodic"].ranges["frequency"] == pytest.approx((2.5 / 40, 0.25 / 0.05, 5 / 40))
    assert OFFERS["probing", "aging"].priors["rate"] == pytest.approx((0.0, 0.5 / 400))
    assert OFFERS["probing", "base-slip"].scales["compliance"] == pytest.approx(0.2 * 0.02 / 900)
    (periodic,) = (e for e in entries(SIZES) if e.title == "periodic")
    free, start, _ = periodic.declare(Model(energy("neo-hookean"), None, (periodic.effect,)), ("r1",), ())
    f = free["effects.periodic.frequency"]
    assert np.allclose([f.lower, f.upper, start["effects.periodic.frequency"]], [0.0625, 5.0, 0.125])


def test_every_form_is_nominated_or_reached_from_one_that_is():
    """A form that counts in the prior and that no search comes to would only make the others less likely."""
    model = Model(energy("neo-hookean"), None, tuple(e.effect for e in entries(SIZES))).across(("r1", "r2"))
    found = entries(SIZES)
    offered = {c.key: c for e in found for c in e.declare(model, ("r1",), ("r2",))[2]}
    candidates = linked(found, offered)
    reached = {k for k, c in candidates.items() if c.nominated}
    assert not any(c.beside for c in candidates.values() if c.widens), "weighed in any case, so nobody's neighbour"
    while more := {b for k in reached for b in candidates[k].beside} - reached:
        reached |= more
    assert reached == set(candidates)
    assert "viscoelasticity/load-dependent" in reached

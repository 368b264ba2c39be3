"""Other forms of the effects in a set: where they are started, and what of the search's budget they have."""

import numpy as np
import pytest
from spring_bench import CANDIDATES, Spring, spring

from tissuejax.diagnosis import neighbours
from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import refit
from tissuejax.diagnosis.search import Budget, Search, search
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, STIFF, ONSET, NOISE = 900.0, 4000.0, 0.12, 5.0


class Counting(Spring):
    """The spring, every prediction counted: its quadratic term has a richer form, with an offset."""

    def predict(self, values, recordings=None):
        self.spent += 1
        return super().predict(values, recordings)


def counting() -> Counting:
    made = spring({"form.c": 8.0, "offset.value": 2.0})
    rich = Candidate("form", ("form.c", "offset.value"), form="rich", nominated=False, beside=("form",))
    plain = Candidate("form", ("form.c",), beside=("form/rich",))
    kept = {f: getattr(made, f) for f in Spring.__dataclass_fields__}
    kept["candidates"] = {"form": plain, "form/rich": rich, "wave": CANDIDATES["wave"]}
    return Counting(**kept)


def test_between_two_sizes_a_search_may_spend_what_lies_between():
    made = counting()
    s = Search(made, white(made), Budget(spend=(100.0, 200.0, 400.0)))
    for size, allowed in ((0, 100), (0.5, 150), (1, 200), (1.5, 300), (2, 400), (7, 400)):
        s.size = size
        made.spent = allowed
        assert not s.exhausted
        made.spent = allowed + 1
        assert s.exhausted


@pytest.mark.parametrize(("last", "reached"), [(1e9, True), (0.0, False)], ids=["something left", "nothing left"])
def test_what_is_left_in_the_end_goes_to_other_forms_of_the_leading_sets(last, reached):
    made, told = counting(), []

    def report(note):
        told.append(note)
        made.spent += 1e6 * ({"wave", "form"} <= set(told))  # after the first extension no other form can be afforded

    s = search(made, Budget(most=2, spend=(1e4, 1e4, last)), report)
    assert ("form/rich" in told) == reached
    assert (s.best.keys == ("form/rich",)) == reached


@pytest.mark.parametrize(("spent", "kept"), [(0.0, True), (1e4, False)], ids=["little", "more"])
def test_a_form_that_few_steps_do_not_show_is_refitted_to_the_end_where_little_has_been_spent(spent, kept, monkeypatch):
    made = counting()
    s = Search(made, white(made), Budget())
    s.refits[frozenset()] = s.refit((), {})
    plain = s.refits[frozenset({"form"})] = s.refit(("form",), {})
    monkeypatch.setattr(neighbours, "PROMISING", -np.inf)
    made.spent = spent
    assert (frozenset({"form/rich"}) in neighbours.neighbours(s, plain)) == kept
    assert (frozenset({"form/rich"}) in s.dropped) != kept


@pytest.fixture(scope="module")
def crimped() -> MaterialBench:
    """Neo-Hookean with fibres along x that bear from a squared stretch of 1 + ONSET on, pulled and pressed along x.

    psi = mu/2 (I1 - 3) + k/2 (l^2 - 1 - ONSET)^2, nominal stress mu (l - 1/l^2) + 2 k (l^2 - 1 - ONSET) l in pull.
    """
    rng, up = np.random.default_rng(11), np.interp(np.linspace(0, 1, 120), [0.1, 0.6, 1.0], [0.0, 1.0, 0.0])
    time, recordings = np.linspace(0.0, 12.0, 120), {}
    for name, stretch in (("r1", 1 + 0.25 * up), ("r2", 1 - 0.2 * up)):
        stress = MU * (stretch - stretch**-2) + 2 * STIFF * np.maximum(stretch**2 - 1 - ONSET, 0.0) * stretch
        channel = Channel(time, stress + NOISE * rng.standard_normal(120), "Pa", NOISE)
        inputs, told = {"time": time, "stretch": stretch}, {"direction": (1.0, 0.0, 0.0)}
        recordings[name] = Recording(name, "uniaxial", inputs, {"nominal_stress": channel}, told)
    names, sigma = tuple(recordings), dict.fromkeys(recordings, NOISE)
    return MaterialBench.of(Sample("s", recordings), energy("neo-hookean"), names, (), sigma, ["anisotropy"])


def test_fibres_that_had_to_be_steep_are_soon_found_to_be_crimped(crimped):
    """A few steps from the steep fibres must show it: further, or with their exponent, the slope is lost."""
    noise, plain = white(crimped), crimped.candidates["anisotropy/in the xy plane"]
    steep = refit(crimped, noise, (plain.key,), {**plain.grid[0], "effects.anisotropy.angle": 0.02})
    assert steep.values["effects.anisotropy.k2"] > 2.0
    assert steep.chi2 > 2 * steep.n
    for start in crimped.candidates["anisotropy/crimped"].grid:
        begun = refit(crimped, noise, ("anisotropy/crimped",), {**steep.values, **start}, iterations=5)
        assert begun.chi2 < steep.chi2
    done = refit(crimped, noise, ("anisotropy/crimped",), begun.values)
    assert done.chi2 < 1.2 * done.n
    assert done.values["effects.anisotropy.onset"] == pytest.approx(ONSET, abs=0.02)

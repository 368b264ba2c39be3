"""The recipe of docs/new-effect.md followed: its block becomes a file, and the diagnosis finds the effect."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from tissuejax import effects as package
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.probing_catalogue import probing_entries
from tissuejax.effects.catalogue import effects
from tissuejax.effects.form import Probed
from tissuejax.energies.catalogue import energy
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

RECIPE = Path(__file__).parents[2] / "docs" / "new-effect.md"
C10, C20, RATE, NOISE = 620.0, 540.0, 3e-5, 4.0
TRIED = ["swelling", "drift", "slack", "aging", "permanent-set", "energy-form"]


@pytest.fixture
def swelling(tmp_path, monkeypatch):
    """The block of the recipe as a file of the effects' folder, for the time of a test."""
    (block,) = re.findall(r"```python\n(.*?)```", RECIPE.read_text(), re.S)
    assert len([line for line in block.splitlines() if line.strip()]) <= 40
    (tmp_path / "swelling.py").write_text(block)
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    yield effects("homogeneous")["swelling"]
    del sys.modules["tissuejax.effects.swelling"], package.swelling


def sample(rate: float) -> Sample:
    """Pulls and a planar test 300 s apart of a reduced polynomial, closed form, with noise; nothing of tissuejax."""
    rng = np.random.default_rng(7)
    tests = {
        "pull": ("uniaxial", 1.3),
        "push": ("uniaxial", 0.75),
        "planar": ("planar", 1.25),
        "last": ("uniaxial", 1.25),
    }
    recordings = {}
    for k, (name, (kind, far)) in enumerate(tests.items()):
        time = np.linspace(0, 20, 300)
        drive = np.interp(time, [0, 1, 8, 12, 19], [1, 1, far, far, 1])
        l = drive / (1 + rate * (300 * k + time))
        square = l**-1 if kind == "uniaxial" else 1.0
        i1 = l**2 + square + 1 / (l**2 * square)
        stress = 2 * (C10 + 2 * C20 * (i1 - 3)) * (l - 1 / (l**3 * square))
        channel = Channel(time, stress + NOISE * rng.standard_normal(len(time)), "Pa", NOISE)
        start = {"start": 300.0 * k}
        recordings[name] = Recording(name, kind, {"time": time, "stretch": drive}, {"nominal_stress": channel}, start)
    return Sample("recipe", recordings)


def test_the_new_effect_is_found_where_it_is_and_off_where_it_is_not(swelling):
    found = diagnose(sample(RATE), effects=TRIED)
    assert found.verdict.kind == "found"
    assert found.verdict.chosen.keys == ("swelling",)
    rate, std = (getattr(found.verdict.chosen, k)["effects.swelling.rate"] for k in ("values", "std"))
    assert rate == pytest.approx(RATE, abs=4 * std)
    clean = diagnose(sample(0.0), effects=TRIED)
    assert clean.verdict.kind == "nothing-missing"


def test_the_new_effect_is_exactly_nothing_at_neutral(swelling):
    from tests.specimens import BASE, VALUES, every_kind, stresses
    from tissuejax.experiments.predictor import predictor

    kinds, names = every_kind(), ["tension", "compression", "planar"]
    base = stresses(predictor(BASE, kinds, names).predict(VALUES))
    off = stresses(predictor(BASE.with_effects(swelling()), kinds, names).predict(VALUES))
    for name in names:
        np.testing.assert_array_equal(off[name], base[name])


PROBING = '''
from collections.abc import Mapping
from typing import ClassVar

from tissuejax.effects.effect import Effect
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class Crosstalk(Effect):
    """The camera's trigger is heard in the force: force + gain. Revealed by it. Blind: none. Source: none."""

    name: ClassVar[str] = "crosstalk"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    reveals: ClassVar[str] = "force at rest"
    blind: ClassVar[str] = "nothing"
    source: ClassVar[str] = "none"
    amplitudes: ClassVar[tuple[str, ...]] = ("gain",)
    misjudged: ClassVar[Mapping[str, float]] = {"gain": 0.2}

    @property
    def parameters(self):
        return (Parameter("gain", "N", 0.0, scale=0.01),)

    def channels(self, p, test, channels):
        seen = channels["force"]
        return {**channels, "force": Channel(seen.time, seen.values + p["gain"], seen.unit, seen.noise_std)}
'''


def test_a_new_effect_of_probings_is_a_candidate_without_another_edit(tmp_path, monkeypatch):
    (tmp_path / "crosstalk.py").write_text(PROBING)
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    importlib.invalidate_caches()
    try:
        entry = next(e for e in probing_entries(Probed(1.0, 1.0, 1.0)) if e.title == "crosstalk")
        model = Model(energy("neo-hookean"), None, (entry.effect,))
        free, start, (candidate,) = entry.declare(model, ("r1",), ("r2",))
        assert candidate.amplitudes == ("effects.crosstalk.gain",)
        assert start == {"effects.crosstalk.gain": 0.0}
        assert free["effects.crosstalk.gain"].prior == (0.0, 0.2)
    finally:
        del sys.modules["tissuejax.effects.crosstalk"], package.crosstalk


def test_every_effect_of_probings_is_a_candidate_unless_its_size_is_known():
    entries = {e.title for e in probing_entries(Probed(1.0, 1.0, 1.0))}
    assert entries == {n for n, e in effects("probing").items() if e.candidate}
    assert "gravity" not in entries

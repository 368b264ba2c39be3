"""A periodic load is believed only where the misfit is periodic; an exponent on its limit is not believed."""

from dataclasses import replace

import numpy as np
import pytest

from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.plausible import doubts
from tissuejax.diagnosis.refit import refit
from tissuejax.energies.catalogue import energy
from tissuejax.recordings.recording import Channel, Recording, Sample

TIME = np.arange(0, 24.0, 0.06)
LOADS = {  # added to the stress of recording i, Pa, noise 2 Pa
    "periodic": lambda i: 12 * np.sin(2 * np.pi * TIME / 3.1 + i),
    "weak and periodic": lambda i: 1.5 * np.sin(2 * np.pi * TIME / 3.1 + i),
    "drift": lambda i: 2.0 * TIME,
    "one bump": lambda i: 40 * np.exp(-(((TIME - 9 - 3 * i) / 1.5) ** 2)),
    "a step": lambda i: 20.0 * (8 + 4 * i < TIME),
    "dying": lambda i: 30 * np.exp(-TIME / 4) * np.cos(2 * np.pi * TIME / 3.1),
    "in one recording": lambda i: 12 * np.sin(2 * np.pi * TIME / 3.1) * (i == 0),
}


def bench(load):
    """Three pulls of a neo-Hookean specimen, the last one held out, with `load` on the cell."""
    rng = np.random.default_rng(5)
    made = {}
    for i, name in enumerate(("r1", "r2", "r3")):
        stretch = 1 + 0.2 * np.interp(TIME, [2, 8 + i, 14, 20], [0, 1, 1, 0])
        stress = 1000 * (stretch - stretch**-2) + load(i) + 2 * rng.standard_normal(len(TIME))
        channel = Channel(TIME, stress, "Pa", 2.0)
        made[name] = Recording(name, "uniaxial", {"time": TIME, "stretch": stretch}, {"nominal_stress": channel})
    sigma = dict.fromkeys(made, 2.0)
    return MaterialBench.of(
        Sample("s", made), energy("neo-hookean"), ("r1", "r2"), ("r3",), sigma, ["periodic", "anisotropy"]
    )


@pytest.mark.parametrize("name", LOADS)
def test_what_is_not_periodic_earns_no_such_name(name):
    on = bench(LOADS[name])
    base = refit(on, white(on), (), {})
    best = None
    for setting in on.settings(on.candidates["periodic"], base.prediction):
        found = refit(on, white(on), ("periodic",), {**base.values, **setting})
        best = found if best is None or found.chi2 < best.chi2 else best
    assert best.chi2 < base.chi2
    assert bool(doubts(on, white(on), best)) == ("periodic" not in name)


def test_an_exponent_on_its_limit_is_not_believed():
    on = bench(LOADS["periodic"])
    base = refit(on, white(on), (), {})
    path = "effects.anisotropy.k2"
    most = on.free[path].upper
    # e^10 at the largest stretch, 1.2: k2 (1.2^2 - 1)^2 = 10
    assert most == pytest.approx(10 / 0.44**2)
    ran = replace(base, values={**base.values, path: most}, at_bound=(path,))
    assert doubts(on, white(on), ran)
    assert not doubts(on, white(on), replace(base, values={**base.values, path: 0.3 * most}))

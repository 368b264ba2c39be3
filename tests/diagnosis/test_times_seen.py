"""No relaxation is tried that is quicker than what the finest sampling of a sample's recordings can show."""

from dataclasses import replace

import numpy as np
import pytest

from tissuejax.diagnosis.catalogue import Entry
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.diagnosis.material import MaterialBench
from tissuejax.effects.catalogue import effects
from tissuejax.effects.form import Probed, Sizes
from tissuejax.energies.catalogue import energy
from tissuejax.estimation.series import finest
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

SIZES = Sizes(energy=100.0, strain=0.3, force=1.0, session=60.0, recording=20.0, finest=0.5)
PROBED = Probed(modulus=900.0, height=0.02, session=60.0, finest=0.5)
OFFERS = {
    **{f"homogeneous/{n}": kind.in_material_tests(SIZES) for n, kind in effects("homogeneous").items()},
    **{f"probing/{n}": kind.in_probings(PROBED) for n, kind in effects("probing").items()},
}
REMEMBER = [k for k, o in OFFERS.items() if o.effect.times]


def swung(name: str, time: np.ndarray, dashpot: float = 0.0, last: float = 4.0, noise: float = 0.0) -> Recording:
    """To 20 % and back within twice `last` seconds; neo-Hookean (mu 4 kPa), beside it a dashpot, Pa s."""
    stretch = 1.1 - 0.1 * np.cos(np.pi * time / last)
    rate = 0.1 * np.pi / last * np.sin(np.pi * time / last)
    stress = 4000 * (stretch - stretch**-2) + dashpot * rate
    stress = stress + noise * np.random.default_rng(int(last)).normal(size=len(time))
    return Recording(
        name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": Channel(time, stress, "Pa", 5.0)}
    )


@pytest.mark.parametrize("key", REMEMBER)
def test_times_are_scanned_and_fitted_from_the_sampling_on(key):
    entry = Entry.of(OFFERS[key])
    assert entry.quickest == 0.5
    model = Model(energy("neo-hookean"), None, (entry.effect,)).across(("r",))
    for offer, least in ((entry, 0.5), (replace(entry, quickest=0.0), 0.0)):
        free, start, candidates = offer.declare(model, ("r",), ())
        times = [p for p in free if p.rpartition(".")[2] in entry.effect.times]
        assert times
        assert all(free[p].lower >= least and start[p] >= least for p in times)
        tried = [v for c in candidates for s in c.grid for p, v in s.items() if p in times]
        assert min(tried, default=0.5) >= least
        assert least or min(free[p].lower for p in times) < 0.5


def test_the_recording_that_is_sampled_most_finely_tells():
    """0.05 s in one, 1 s in the other; where sampling is uneven its finest tenth counts."""
    fine, coarse = swung("fine", np.arange(0, 10, 0.05)), swung("coarse", np.arange(0, 40, 1.0))
    bench = MaterialBench.of(
        Sample("two", {r.name: r for r in (fine, coarse)}),
        energy("neo-hookean"),
        ("fine", "coarse"),
        (),
        {"fine": 5.0, "coarse": 5.0},
        ["viscoelasticity"],
    )
    assert bench.sizes.finest == pytest.approx(0.05)
    lower = {p: f.lower for p, f in bench.free.items() if ".tau" in p}
    assert lower
    assert min(lower.values()) == pytest.approx(0.05)
    uneven = np.cumsum(np.repeat([0.01, 2.0], [12, 88]))
    assert finest([uneven]) == pytest.approx(0.01)
    assert finest([uneven[4:]]) == pytest.approx(2.0)  # seven of 95 steps are short
    assert finest([np.array([1.0]), np.array([2.0, 2.0])]) == 0.0


@pytest.mark.slow
def test_a_diagnosis_states_no_time_below_the_sampling():
    """A dashpot has no time: the quickest relaxation that the samples can show stands for it, and nothing quicker."""
    lasts = {"quick": 4.0, "middle": 12.0, "slow": 40.0}
    made = {n: swung(n, np.arange(0, 2 * last, last / 20), 8e3, last, noise=5.0) for n, last in lasts.items()}
    found = diagnose(Sample("dashpot", made), "neo-hookean", effects=["viscoelasticity"], holdout=())
    assert found.answered.judgement.names == ("viscoelasticity",)
    times = {p: v for p, v in found.answered.chosen.values.items() if ".tau" in p}
    assert min(times.values()) == pytest.approx(0.2)

"""Relaxation that is quicker the more it is loaded is tried, and has more evidence than any Prony series."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tissuejax as tj
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, SHARE, TAU, LOAD, POWER, NOISE = 4000.0, 0.6, 40.0, 150.0, 4.0, 4.0  # Pa, 1, s, Pa, 1, Pa


def flowing(time: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Nominal stress P - g z of a spring and a dashpot whose flow grows with a power of its load (Bergstrom and Boyce
    1998, in one dimension), dz/dt = (P - z)/tau (1 + ((P - z)/load)^2)^((m - 1)/2)."""

    def elastic(t: float) -> float:
        s = np.interp(t, time, stretch)
        return MU * (s - s**-2)

    def flow(t: float, z: np.ndarray) -> np.ndarray:
        over = elastic(t) - z
        return over / TAU * (1 + (over / LOAD) ** 2) ** ((POWER - 1) / 2)

    z = solve_ivp(flow, (time[0], time[-1]), [0.0], t_eval=time, method="LSODA", rtol=1e-8, max_step=0.5).y[0]
    return MU * (stretch - stretch**-2) - SHARE * z


@pytest.mark.slow
def test_relaxation_that_load_quickens_is_told_from_a_prony_series():
    rng, made = np.random.default_rng(4), {}
    for far in (1.02, 1.05, 1.1):
        time = np.linspace(0.0, 60.0, 400)
        stretch = np.interp(time, [0, 1, 3, 60], [1, 1, far, far])
        stress = flowing(time, stretch) + NOISE * rng.standard_normal(len(time))
        channel = Channel(time, stress, "Pa", NOISE)
        made[f"to {far}"] = Recording(
            f"to {far}", "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, {}
        )
    found = tj.diagnose(Sample("flowing", made), "neo-hookean", effects=["viscoelasticity", "nonlinear-viscosity"])
    assert [e["name"] for e in found.as_dict()["effects"]] == ["viscoelasticity"]
    weighed = (w.evidence for w in found.answered.exploration.weighed.values())
    alone = {e.keys[0]: e.log_evidence for e in weighed if len(e.keys) == 1}
    assert len(alone) > 5
    others = max(x for key, x in alone.items() if key != "viscoelasticity/load-dependent")
    assert alone["viscoelasticity/load-dependent"] > others + 10

"""Small specimens for tests: protocols of every kind of material test, without measurement."""

import numpy as np

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

BASE = Model(ReducedPolynomial(order=2))
VALUES = {"energy.C10": 450.0, "energy.C20": 520.0}
SIZE = {"area": 5e-4, "height": 0.02, "diameter": 0.025}


def ramp(time, *corners):
    """Piecewise linear through (time, value) corners."""
    return np.interp(time, [c[0] for c in corners], [c[1] for c in corners])


def recording(name, kind, time, drive, **attributes):
    """A recording of `kind` with zero stress."""
    zero = Channel(time, np.zeros_like(drive), "Pa", 10.0)
    driven = "shear" if kind == "simple-shear" else "stretch"
    return Recording(name, kind, {"time": time, driven: drive}, {"nominal_stress": zero}, SIZE | attributes)


def every_kind(n=60):
    """One recording of each kind: loading, hold, unloading."""
    time = np.linspace(0.0, 20.0, n)
    up = ramp(time, (0, 0.0), (6, 1.0), (12, 1.0), (18, 0.0), (20, 0.0))
    along = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
    found = [
        recording("tension", "uniaxial", time, 1 + 0.3 * up, direction=along["x"], start=0.0),
        recording("compression", "uniaxial", time, 1 - 0.25 * up, direction=along["z"], start=100.0),
        recording("planar", "planar", time, 1 + 0.25 * up, direction=along["y"], start=200.0),
        recording("equibiaxial", "equibiaxial", time, 1 + 0.15 * up, start=300.0),
        recording("biaxial", "biaxial", time, np.stack([1 + 0.2 * up, 1 + 0.1 * up], -1), start=400.0),
        recording("shear", "simple-shear", time, 0.4 * up, start=500.0),
    ]
    return Sample("made", {r.name: r for r in found})


def stresses(predicted):
    """Predicted nominal stresses by recording, as numpy."""
    return {name: np.asarray(r.channels["nominal_stress"].values) for name, r in predicted.items()}

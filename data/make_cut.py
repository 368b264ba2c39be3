"""The example cut of this folder, `cut.h5`: three strokes of a blade with friction, made by another simulator.

python data/make_cut.py          some seconds; the truth is printed, and written into the file's notes

The forces come from `challenge/cutting_foundation.py` (implicit, one-dimensional, its own laws), not from the finite
elements that fit it: a fit that finds the toughness has found something.
"""

from pathlib import Path

import h5py
import numpy as np

from tissuejax.challenge.cutting_cases import Case, Trial, write
from tissuejax.challenge.cutting_foundation import Knife, Slab, draw

# Strong enough that behind the blade the faces hold no more (an exponential law never quite ends: at 130 kPa they still
# press on its flats, by half of what the tissue does, and a fit takes that for friction)
SPACING = 1.2e-5  # m
HERE = Path(__file__).parent
TOUGHNESS, STRENGTH, FRICTION, MU, NOISE = 20.0, 210e3, 0.1, 3000.0, 0.002
SLAB, BLADE = Slab(0.04, 0.01, MU, 12 * MU, 0.5), Knife(5e-4, 0.25, 2e10)


def strokes() -> list[Trial]:
    """There, back and again through the same cut; fast through fresh tissue; shallow through fresh tissue."""
    out = []
    for name, legs, speed, deep in (
        ("there-back-again", (-0.003, 0.034, 0.004, 0.03), 2e-3, 0.009),
        ("fast", (-0.003, 0.034), 2e-2, 0.009),
        ("shallow", (-0.003, 0.034), 5e-3, 0.005),
    ):
        time, x = np.zeros(1), np.array(legs[:1])
        for a, b in zip(legs, legs[1:]):
            time = np.append(time, time[-1] + abs(b - a) / speed * np.arange(1, 161) / 160)
            x = np.append(x, a + (b - a) * np.arange(1, 161) / 160)
        out.append(Trial(name, time, x, np.where((x > 0) & (x < SLAB.length), deep, 0.0), 0.0))
    return out


def main() -> None:
    """Make and write it."""
    rng, force = np.random.default_rng(7), {}
    for t in strokes():
        rub = FRICTION * np.tanh(np.gradient(t.x, t.time) / 2e-4)
        drawn = draw(
            SLAB, BLADE, t.x, lambda x: np.full_like(x, TOUGHNESS), lambda x: np.full_like(x, STRENGTH), SPACING,
            friction=rub,
        )  # fmt: skip
        force[t.name] = drawn * t.depth + NOISE * rng.standard_normal(len(t.x))
    path = HERE / "cut.h5"
    write(Case("cut-example", strokes(), force, NOISE, SLAB, BLADE, {}), path)
    with h5py.File(path, "a") as file:
        file.attrs["notes"] = (
            f"simulated, implicit foundation model: toughness {TOUGHNESS} J/m^2, strength {STRENGTH:g} Pa, friction "
            f"{FRICTION}, shear modulus {MU:g} Pa, wave modulus {12 * MU:g} Pa, noise {NOISE} N"
        )
    print(path, TOUGHNESS, STRENGTH, FRICTION)


if __name__ == "__main__":
    main()

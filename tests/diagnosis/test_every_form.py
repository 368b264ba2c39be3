"""An effect whose law is unlike its plain form: all forms are tried where the best single effect leaves much."""

import numpy as np
import pytest

import tissuejax as tj
from tissuejax.recordings.recording import Channel, Recording, Sample

C1, C2, LOST, SCALE, NOISE = 450.0, 210.0, 0.75, 25.0, 15.0  # Pa; share of stiffness; J/m^3; Pa
PATHS = {  # s, stretch
    "tension": [(0, 1), (1, 1), (14, 1.256), (20, 1.256), (33, 1), (35, 1)],
    "compression": [(0, 1), (1, 1), (3.5, 0.852), (6, 1), (12, 0.663), (20, 0.663), (26, 1), (31.5, 0.664), (39, 1)],
    "both": [(0, 1), (1, 1), (4.4, 1.124), (14.7, 0.75), (28.6, 1.254), (30.7, 1.254), (37.7, 1), (39.6, 1)],
}


def damaged(stretch: np.ndarray) -> np.ndarray:
    """Mooney and Rivlin's uniaxial nominal stress, Pa, with the damage of Simo 1987: 1 - d (1 - exp(-W_max / m))."""
    W = C1 * (stretch**2 + 2 / stretch - 3) + C2 * (stretch**-2 + 2 * stretch - 3)
    eta = 1 - LOST * (1 - np.exp(-np.maximum.accumulate(W) / SCALE))
    return eta * 2 * (stretch - stretch**-2) * (C1 + C2 / stretch)


def diagnosed() -> tuple[list[str], dict]:
    """Names and parameters of what is found, of the two effects that hysteresis may be."""
    rng, made = np.random.default_rng(8), {}
    for name, corners in PATHS.items():
        time = np.linspace(0.0, corners[-1][0], 300)
        stretch = np.interp(time, *zip(*corners, strict=True))
        seen = Channel(time, damaged(stretch) + NOISE * rng.standard_normal(len(time)), "Pa", NOISE)
        made[name] = Recording(name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": seen}, {})
    said = tj.diagnose(Sample("damaged", made), "reduced-polynomial-2", effects=["softening", "viscoelasticity"])
    effects = said.as_dict()["effects"]
    inner = {k.rpartition(".")[2]: x["value"] for e in effects for k, x in e["parameters"].items()}
    return [e["name"] for e in effects], inner


@pytest.mark.slow
def test_damage_on_the_virgin_path_is_softening_and_no_relaxation():
    names, values = diagnosed()
    assert names == ["softening"]
    assert values["d"] == pytest.approx(LOST, rel=0.1)

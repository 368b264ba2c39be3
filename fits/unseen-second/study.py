"""The second set of real recordings that nobody here had seen: is the cause named, and what else?

The tables are not part of the project: `TISSUEJAX_UNSEEN` names the folder that holds them, as README.md says. One file
a sample under `results/`; a stopped study goes on.

tissuejax study fits/unseen-second
"""

import sys
from pathlib import Path

import numpy as np

from tissuejax.recordings.recording import Sample
from tissuejax.recordings.specimens import NO_TIME

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "unseen"))

import unseen_page  # noqa: E402
from panel_samples import uniaxial  # noqa: E402
from unseen_page import columns, untimed  # noqa: E402

WIDE = 30e-3 * 2.65e-3  # m^2: the silicone strip
FILLED = (40.0, 10e-3 * 4e-3)  # mm, m^2: the silicone with carbon black
FILM = 16.5  # mm between the grips
FILM_SECTIONS = {  # m^2
    "cycles_pristine_nc_1": 2.82e-3 * 0.30e-3,
    "pull_pristine_nc_1": 2.82e-3 * 0.22e-3,
    "pull_pristine_nc_2": 2.82e-3 * 0.31e-3,
    "pull_pristine_nc_3": 2.82e-3 * 0.29e-3,
}
STRIPS = {  # mm between the grips, section in m^2, direction
    "ISAA20170106_U2": (14.0, 2.81e-3 * 2.525e-3, (1.0, 0.0, 0.0)),
    "ISAA20170106_L2": (7.0, 3.025e-3 * 2.895e-3, (0.0, 1.0, 0.0)),
}
FIBRE, SHEET, NORMAL = np.eye(3)
CUBES = {  # section in m^2, direction of the motion, normal of the sheared face
    "TSL1_M3_FF": (91.5975e-6, FIBRE, None),
    "TSL1_M6_SS": (101.321e-6, SHEET, None),
    "TSL1_M9_NN": (115.329e-6, NORMAL, None),
    "TSL1_M1_FS": (91.5975e-6, SHEET, FIBRE),
    "TSL1_M8_NS": (115.329e-6, SHEET, NORMAL),
}
CLOT = 1e-4  # m^2, assumed


def rubber(tests: tuple[str, ...]) -> Sample:
    """Pressed and held; compression is positive in the table."""
    t, _, _, stress, strain = columns("zahar-rubber/small_1.csv")
    size = {"area": np.pi * 5.41e-3**2 / 4, "diameter": 5.41e-3, "height": 6e-3}
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t, 1 - strain, -1e6 * stress, **size)})


def silicone(tests: tuple[str, ...]) -> Sample:
    """Two cycles; strain by video."""
    t, _, force, strain, _ = columns(f"whiterabbit-silicone/{tests[0]}.csv")
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t, 1 + 0.01 * strain, 1e3 * force / WIDE, area=WIDE)})


def filled(tests: tuple[str, ...]) -> Sample:
    """Three triangles; the position at the stamp of each force, from both tables of positions."""
    length, area = FILLED
    position, stamp, force, t = columns("richgumy-cbsilicone/v19_triangles.csv")
    more, when = columns("richgumy-cbsilicone/v19_positions_at_turns.csv")
    at, order = np.unique(np.concatenate([stamp, when]), return_index=True)
    path = np.concatenate([position, more])[order]
    on = t <= at[-1]
    stretch = 1 - np.interp(t[on], at, path) / length
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t[on], stretch, force[on] / area, area=area)})


def film(tests: tuple[str, ...]) -> Sample:
    """Films, strain from the first row as the source has it."""
    found = {}
    for test in tests:
        t, x, force = columns(f"kiynchin-gelatin/{test}.csv")
        area = FILM_SECTIONS[test]
        found[test] = uniaxial(test, t, 1 + (x - x[0]) / FILM, force / area, area=area)
    return Sample(tests[0], found)


def pull(tests: tuple[str, ...]) -> Sample:
    """Hencky strain and Cauchy stress of a dumb-bell."""
    t, strain, stress = columns(f"marechal-soro/{tests[0]}.csv")
    stretch = np.exp(strain)
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t, stretch, 1e6 * stress / stretch)})


def strips(tests: tuple[str, ...]) -> Sample:
    """Two strips at right angles."""
    found = {}
    for test in tests:
        t, x, force = columns(f"aorta-tissuemechanicslab/{test}.csv")
        length, area, direction = STRIPS[test]
        made = uniaxial(test, t, 1 + (x - x[0]) / length, force / area, area=area)
        made.attributes["direction"] = np.array(direction)
        found[test] = made
    return Sample(tests[0], found)


def cubes(tests: tuple[str, ...]) -> Sample:
    """Pulled and pressed, or sheared; the first letter of a mode is the normal of the sheared face."""
    found = {}
    for test in tests:
        area, direction, normal = CUBES[test]
        strain, force, *_ = columns(f"ml-soft-myocardium/{test}.csv")
        if normal is None:
            found[test] = untimed(test, "uniaxial", 1 + strain, force / area, direction=direction)
        else:
            found[test] = untimed(test, "simple-shear", strain, force / area, direction=direction, normal=normal)
    return Sample(tests[0], found, notes=NO_TIME)


def clots(tests: tuple[str, ...]) -> Sample:
    """Sheared both ways."""
    found = {}
    for test in tests:
        shear, force, _ = columns(f"ml-soft-bloodclot/{test}.csv")
        found[test] = untimed(test, "simple-shear", shear, force / CLOT)
    return Sample(tests[0], found, notes=NO_TIME)


def mouse(tests: tuple[str, ...]) -> Sample:
    """Time in minutes, stamped to 0.01."""
    t, strain, stress = columns(f"mouse-dma/{tests[0]}.csv")
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], 60 * t, 1 + 0.01 * strain, 1e6 * stress)})


MAKERS = {
    "rubber-hold": rubber,
    "silicone-cycles": silicone,
    "filled-silicone": filled,
    "gelatin-cycles": film,
    "gelatin-pulls": film,
    "silicone-pull": pull,
    "aorta": strips,
    "myocardium": cubes,
    "blood-clot": clots,
    "mouse-pull": mouse,
}


def main(where: Path) -> str:
    """Diagnose what has no result yet, grade; returns the answer in a sentence."""
    return unseen_page.main(where, MAKERS)


if __name__ == "__main__":
    print(main(HERE))

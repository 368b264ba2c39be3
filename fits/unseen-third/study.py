"""The third set of real recordings that nobody here had seen: is the cause named, and what else?

The tables are not part of the project: `TISSUEJAX_UNSEEN` names the folder that holds them, as README.md says. One file
a sample under `results/`; a stopped study goes on.

tissuejax study fits/unseen-third
"""

import csv
import sys
from pathlib import Path

import numpy as np

from tissuejax.recordings.recording import Sample
from tissuejax.recordings.specimens import NO_TIME

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "unseen"))

import unseen_page  # noqa: E402
from panel_samples import uniaxial  # noqa: E402
from unseen_page import columns, folder, untimed  # noqa: E402

FOAM = (29.539e-3, 62.95e-3 * 51.79e-3)  # m, m^2
GEL_RADIUS = 24e-3  # m: "width", which the source takes for a radius; it scales the stress alone
GEL_HEIGHTS = {"gelatin25_rates": 28e-3, "porcine_gelatin20": 18e-3}
FILLED = (27e-3, np.pi * 12.5e-3**2)  # m, m^2: a "width" of 25, here a diameter
PIECES = {  # of one test on one clock
    "trial21": ("trial21_loading", "trial21_hold", "trial21_unloading"),
    "trial27": ("trial27_start_of_loading", "trial27_end_of_loading_hold_start_of_unloading"),
}
DUMB_BELL = (29.212e-3, 10.176e-6)  # m between the grips after the preload, m^2
SLACK_LENGTH = 0.95  # of L0: where the muscle's ramps begin, next to no stress
AXIS, OTHER, _ = np.eye(3)
DIRECTIONS = {"longitudinal": AXIS, "transverse": OTHER, "axial": AXIS, "radial": OTHER}
WHOLE = {"axial": 1.435, "radial": 1.415}  # stretch up to which no specimen has left the group's mean


def foam(tests: tuple[str, ...]) -> Sample:
    """Pressed, held and let go."""
    height, area = FOAM
    t, _, pressed, force = columns(f"foam_hold/{tests[0]}.csv")
    size = {"area": area, "height": height}
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t, 1 - 1e-3 * pressed / height, -force / area, **size)})


def muscle(tests: tuple[str, ...]) -> Sample:
    """Ramps from 0.95 of the reference length, in 0.1 to 100 s, and holds."""
    found = {}
    for test in tests:
        t, length, stress, _ = columns(f"cardiac_relaxed/{test}.csv")
        found[test] = uniaxial(test, t, length / SLACK_LENGTH, 1e3 * stress)
    return Sample("cardiac muscle", found)


def cycles(tests: tuple[str, ...]) -> Sample:
    """Pressed to half its height and let go, twice in part."""
    t, _, _, strain, stress, _ = columns(f"cyclic_compression/{tests[0]}.csv")
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t, 1 - 0.01 * strain, -1e6 * stress)})


def gel(folder_of: str, tests: tuple[str, ...]) -> Sample:
    """A cylinder pressed by a flat plate at two speeds, and held."""
    height, area = GEL_HEIGHTS[folder_of], np.pi * GEL_RADIUS**2
    found = {}
    for test in tests:
        t, travel, force = columns(f"{folder_of}/{test}.csv")
        size = {"area": area, "height": height, "diameter": 2 * GEL_RADIUS}
        found[test] = uniaxial(test, t, 1 - 1e-3 * travel / height, -force / area, **size)
    return Sample(folder_of, found)


def bovine(tests: tuple[str, ...]) -> Sample:
    """The firmer gel."""
    return gel("gelatin25_rates", tests)


def porcine(tests: tuple[str, ...]) -> Sample:
    """The softer gel."""
    return gel("porcine_gelatin20", tests)


def filled(tests: tuple[str, ...]) -> Sample:
    """A gel with starch pressed at two speeds, held and let go; the head moves evenly where no row was read."""
    height, area = FILLED
    found = {}
    for test in tests:
        t, travel, force = np.concatenate([columns(f"gelatin_starch_compress/{p}.csv") for p in PIECES[test]], axis=1)
        t, first = np.unique(t, return_index=True)
        stretch, stress = 1 - 1e-3 * travel[first] / height, -force[first] / area
        found[test] = uniaxial(test, t, stretch, stress, area=area, height=height)
    return Sample("filled gelatin", found)


def bladder(tests: tuple[str, ...]) -> Sample:
    """Two strips; kPa assumed."""
    found = {}
    for test in tests:
        stress, strain = columns(f"bladder_two_directions/{test}.csv")
        found[test] = untimed(test, "uniaxial", 1 + strain, 1e3 * stress, direction=DIRECTIONS[test])
    return Sample("bladder", found, notes=NO_TIME)


def artery(tests: tuple[str, ...]) -> Sample:
    """Means of a group in two directions, as far as the group is whole; kPa assumed."""
    found = {}
    for test in tests:
        stretch, stress, _ = columns(f"ctl_axial_radial/{test}.csv")
        on = stretch <= WHOLE[test]
        found[test] = untimed(test, "uniaxial", stretch[on], 1e3 * stress[on], direction=DIRECTIONS[test])
    return Sample("artery", found, notes=NO_TIME)


def dumb_bell(tests: tuple[str, ...]) -> Sample:
    """Of twenty pulls the first and the twentieth, there and back."""
    length, area = DUMB_BELL
    with (folder() / "dogbone_sinus/cycles_1_2_20.csv").open() as file:
        rows = list(csv.DictReader(file))
    found = {}
    for test in tests:
        own = [r for r in rows if r["cycle"] in (f"{test}-Stretch", f"{test}-Recover")]
        t, moved, force = (np.array([float(r[k]) for r in own]) for k in ("time_s", "displacement_mm", "force_N"))
        found[test] = uniaxial(test, t, 1 + 1e-3 * moved / length, force / area, area=area)
    return Sample("dumb-bell", found)


MAKERS = {
    "foam-hold": foam,
    "muscle-hold": muscle,
    "pressed-cycles": cycles,
    "bovine-hold": bovine,
    "porcine-hold": porcine,
    "bladder": bladder,
    "artery": artery,
    "dumb-bell": dumb_bell,
    "filled-gel-hold": filled,
}


def main(where: Path) -> str:
    """Diagnose what has no result yet, grade; returns the answer in a sentence."""
    return unseen_page.main(where, MAKERS)


if __name__ == "__main__":
    print(main(HERE))

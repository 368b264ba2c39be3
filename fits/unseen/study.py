"""Real recordings of public repositories that nobody here had seen: is the cause named, and what else?

The tables are not part of the project: `TISSUEJAX_UNSEEN` names the folder that holds them, as README.md says. One file
a sample under `results/`; a stopped study goes on.

tissuejax study fits/unseen
"""

import sys
from pathlib import Path

import numpy as np

from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.recordings.specimens import NO_TIME

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import unseen_page  # noqa: E402
from panel_samples import uniaxial  # noqa: E402
from unseen_page import columns  # noqa: E402

GAUGE, SECTION = 80.0, 22e-6  # mm, m^2: the elastomer's strip
STRIP = (200.0, 24.75e-3 * 3.12e-3)  # mm, m^2: the silicone's
CYLINDERS = {  # diameter and height in mm
    "Li_silicone_1": (18.8, 23.4),
    "Li_silicone_2": (18.1, 22.8),
    "Li_muscle_1": (14.0, 21.0),
    "Li_muscle_2": (14.0, 22.0),
}
BEGUN = {
    "Li_muscle_2": 0.43
}  # s: position is set to zero there; of the others the first row is a reading before the test


def elastomer(tests: tuple[str, ...]) -> Sample:
    """Strips by their crosshead; where they hang slack on the way back is left out."""
    found = {}
    for test in tests:
        t, x, force = columns(f"vhb/{test}.csv")
        taut = (np.arange(len(t)) <= np.argmax(x)) | (force > 0.01 * force.max())
        found[test] = uniaxial(
            test, t[taut], 1 + x[taut] / GAUGE, force[taut] / SECTION, area=SECTION, height=1e-3 * GAUGE
        )
    return Sample(tests[0], found)


def digitised(tests: tuple[str, ...]) -> Sample:
    """Stress in kPa; rows at which the time that the source made steps back are left out."""
    found = {}
    for test in tests:
        t, stretch, stress = columns(f"vhb-digitised/{test}.csv")
        on = t > np.concatenate([[-1.0], np.maximum.accumulate(t)[:-1]])
        found[test] = uniaxial(test, t[on], stretch[on], 1e3 * stress[on])
    return Sample(tests[0], found)


def cylinder(tests: tuple[str, ...]) -> Sample:
    """Pressed and held."""
    (test,) = tests
    diameter, height = CYLINDERS[test]
    t, force, x = columns(f"annemil/{test}.csv")
    on = t > BEGUN.get(test, 0.0)
    area = np.pi * (1e-3 * diameter) ** 2 / 4
    stretch = 1 - (x[on] - x[on][0]) / height
    size = {"area": area, "diameter": 1e-3 * diameter, "height": 1e-3 * height}
    return Sample(test, {test: uniaxial(test, t[on], stretch, -force[on] / area, **size)})


def strip(tests: tuple[str, ...]) -> Sample:
    """Two cycles of a silicone."""
    (test,) = tests
    gauge, area = STRIP
    t, x, force = columns(f"annemil/{test}.csv")
    return Sample(test, {test: uniaxial(test, t, 1 + x / gauge, 1e3 * force / area, area=area, height=1e-3 * gauge)})


def sheet(tests: tuple[str, ...]) -> Sample:
    """Green strain and second Piola-Kirchhoff stress of two axes, paired at the ratio of their last stresses."""
    place, *ratios = tests
    found = {}
    for name in ratios:
        (e1, s1), (e2, s2) = (curve(f"{place}/{axis}_{name}.csv") for axis in ("E11", "E22"))
        share = np.linspace(0, 1, 25)
        green = np.stack([np.interp(share * s1[-1], s1, e1), np.interp(share * s2[-1], s2, e2)], -1)
        stretch = np.sqrt(1 + 2 * green)
        stress = 1e3 * stretch * np.stack([share * s1[-1], share * s2[-1]], -1)
        time = np.arange(len(share), dtype=float)
        inputs = {"time": time, "stretch": stretch}
        found[name] = Recording(name, "biaxial", inputs, {"nominal_stress": Channel(time, stress, "Pa", None)}, {})
    return Sample(place, found, notes=NO_TIME)


def curve(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Strain and stress from rest, in the order of the stress."""
    strain, stress = columns(path)
    order = np.argsort(stress, kind="stable")
    return np.concatenate([[0.0], strain[order]]), np.concatenate([[0.0], stress[order]])


MAKERS = {
    "vhb-cycles": elastomer,
    "vhb-relaxation": elastomer,
    "vhb-digitised": digitised,
    "silicone-hold": cylinder,
    "muscle-hold": cylinder,
    "silicone-strip": strip,
    "biaxial": sheet,
}


def main(where: Path) -> str:
    """Diagnose what has no result yet, grade; returns the answer in a sentence."""
    return unseen_page.main(where, MAKERS)


if __name__ == "__main__":
    print(main(HERE))

"""The fourth set of real recordings that nobody here had seen: is the cause named, and what else?

The tables are not part of the project: `TISSUEJAX_UNSEEN` names the folder that holds them, as README.md says. One file
a sample under `results/`; a stopped study goes on.

tissuejax study fits/unseen-fourth
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

BLOCKS = {"gel-pad-press": (13.98e-3, 1570e-6), "gel-on-hard50-press": (17.0e-3, 1600e-6)}  # m, m^2: of the export
DIAGONAL = (np.sqrt(0.5), np.sqrt(0.5), 0.0)
STRIPS = {  # m between the grips, section in m^2, direction beside a director along x
    "mono_90": (20e-3, 0.21e-3 * 6.5e-3, (1.0, 0.0, 0.0)),
    "mono_45": (12e-3, 0.19e-3 * 5e-3, DIAGONAL),
}
PADS = {"skin-healthy-pads": 32.0e-3, "skin-keloid-pads": 40.73e-3}  # m between them
PAD_SECTION = 8e-3 * 1.5e-3  # m^2: as wide as the pads; a thickness is not stated, and it scales the stress alone


def pressed(tests: tuple[str, ...]) -> Sample:
    """A block between plates, pressed once and let back a little."""
    height, area = BLOCKS[tests[0]]
    t, travel, force, _ = columns(f"{tests[0]}/press.csv")
    size = {"area": area, "height": height, "diameter": 2 * np.sqrt(area / np.pi)}
    return Sample(tests[0], {tests[0]: uniaxial(tests[0], t, 1 - 1e-3 * travel / height, -force / area, **size)})


def strips(tests: tuple[str, ...]) -> Sample:
    """Two strips of one sheet, each pulled once."""
    found = {}
    for test in tests:
        length, area, direction = STRIPS[test]
        t, travel, force = columns(f"lce-strips/{test}.csv")
        found[test] = uniaxial(test, t, 1 + 1e-3 * travel / length, force / area, direction=direction)
    return Sample("liquid crystal elastomer", found)


def pads(tests: tuple[str, ...]) -> Sample:
    """Skin pulled between two pads; snapshots are counted."""
    _, travel, force = columns(f"{tests[0]}/pull.csv")
    stretch = 1 + 1e-3 * travel / PADS[tests[0]]
    return Sample(tests[0], {tests[0]: untimed(tests[0], "uniaxial", stretch, force / PAD_SECTION)}, notes=NO_TIME)


MAKERS = {"gel-press": pressed, "gel-on-bed": pressed, "lce-strips": strips, "skin-pads": pads}


def main(where: Path) -> str:
    """Diagnose what has no result yet, grade; returns the answer in a sentence."""
    return unseen_page.main(where, MAKERS)


if __name__ == "__main__":
    print(main(HERE))

"""Without a model: when force and plates of a fungal steak turn, with what stress recordings begin, and how stiff
silicones are in their first steps.

TISSUEJAX_SHARED=... python fits/real-panel/turns.py
"""

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import panel_samples  # noqa: E402

CLOCK = ("fungi cross-plane, first of each rate", "fungi cross-plane, second of each rate",
         "fungi in-plane, first of each rate", "fungi in-plane, second of each rate")  # fmt: skip
OFFSET = ("liver region1", "liver v2 region2", "tendon incubated 2", "beef 230407_RDG1B", "ecoflex EF30_12_5T")
TOE = ("repeats EF50_0T", "halves EF30_0T", "repeats EF50_37_5T", "repeats EF10_87_5T", "repeats EF10_12_5T")
STEPS, AFTER = 3, 10  # of the recording: those told, and those whose median they are told by
NEAR = 0.995  # of the greatest strain: the plates have turned in the middle of the first time above it


def one_sided(recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, and strain and stress along the first direction, both positive where it is loaded."""
    time = np.asarray(recording.inputs["time"], float)
    strain = np.asarray(recording.inputs["stretch"], float).reshape(len(time), -1)[:, 0] - 1
    stress = np.asarray(recording.channels["nominal_stress"].values, float).reshape(len(time), -1)[:, 0]
    side = np.sign(strain[np.argmax(np.abs(strain))])
    return time, side * strain, side * stress


def main() -> None:
    """Print the tables."""
    listed = {e.id: e for e in panel_samples.entries(tomllib.loads((HERE / "causes.toml").read_text()))}
    print("force turns before the plates, s (sampling step)")
    for name in CLOCK:
        for test, r in panel_samples.build(replace(listed[name], samples=10**6))[0].recordings.items():
            time, strain, stress = one_sided(r)
            first = time <= 0.45 * time[-1]  # the first of two strokes
            far = np.flatnonzero(first & (strain > NEAR * strain[first].max()))
            lead = 0.5 * (time[far[0]] + time[far[-1]]) - time[first][np.argmax(stress[first])]
            print(f"  {test:24s} {lead:6.2f} ({np.median(np.diff(time)):.3f})")
    print("stress at the first sample, of the peak")
    for name in OFFSET:
        found = [one_sided(r)[2] for r in panel_samples.build(listed[name])[0].recordings.values()]
        print(f"  {name:24s}", ", ".join(f"{y[0] / y.max():.1%}" for y in found))
    print(f"modulus (stress over stretch - 1/stretch^2) of the first {STEPS} steps, of that of the {AFTER} after them")
    for name in TOE:
        for test, r in panel_samples.build(listed[name])[0].recordings.items():
            stretch = np.asarray(r.inputs["stretch"], float)
            slope = np.diff(r.channels["nominal_stress"].values) / np.diff(stretch - stretch**-2)
            shares = slope[:STEPS] / np.median(slope[STEPS : STEPS + AFTER])
            print(f"  {name:20s} {test:14s}", "  ".join(f"{x:5.2f}" for x in shares))


if __name__ == "__main__":
    main()

"""Writes the two demonstration samples of `data/demo` from closed forms in plain numpy.

    python data/make_demo.py [FOLDER]

An incompressible block with the reduced polynomial of order 2, W = C10 (I1 - 3) + C20 (I1 - 3)^2, is pulled, pressed
and sheared (planar), with white noise on the stress. `elastic.h5` holds no more than that. `relaxing.h5` conceals
stress relaxation: the isochoric second Piola-Kirchhoff stress runs through one Prony branch,

    S(t) = (1 - g) S_e(t) + h(t),   h' = g S_e' - h / tau,   S_e,i = 2 W'(I1) (1 - I1 / (3 stretch_i^2)),

and the free face gives the pressure, P = (stretch_1^2 S_1 - stretch_3^2 S_3) / stretch_1 (Simo and Hughes 1998,
section 10.3). Nothing of tissuejax is used, so that a fit of these files is a check of it.
"""

import hashlib
import json
import sys
from pathlib import Path

import h5py
import numpy as np

TRUTH = {
    "elastic": {"energy.C10": 620.0, "energy.C20": 540.0, "noise_std": 8.0},
    "relaxing": {"energy.C10": 620.0, "energy.C20": 540.0, "noise_std": 8.0, "fraction": 0.35, "tau": 2.5},
}
# Name, kind, corner points (time in s, stretch) between which the stretch runs straight.
TESTS = (
    ("tension", "uniaxial", [(0, 1.0), (4, 1.35), (12, 1.35), (20, 1.0)]),
    ("compression", "uniaxial", [(0, 1.0), (6, 0.68), (14, 0.68), (24, 1.0)]),
    ("planar", "planar", [(0, 1.0), (10, 1.30), (14, 1.10), (22, 1.30)]),
    ("holdout", "uniaxial", [(0, 1.0), (2, 1.25), (10, 0.75), (16, 0.75), (18, 1.15), (26, 1.0)]),
)
SAMPLES, DIAMETER, HEIGHT = 300, 0.025, 0.025


def principal(kind: str, stretch: np.ndarray) -> np.ndarray:
    """The three principal stretches, (n, 3): loaded, second in-plane, free."""
    second = np.ones_like(stretch) if kind == "planar" else stretch**-0.5
    return np.stack([stretch, second, 1.0 / (stretch * second)], axis=1)


def nominal_stress(kind: str, time: np.ndarray, stretch: np.ndarray, truth: dict[str, float]) -> np.ndarray:
    """Stress on the loaded face, Pa; the Prony branch is exact where S_e is straight between samples."""
    l = principal(kind, stretch)
    i1 = (l**2).sum(axis=1, keepdims=True)
    elastic = 2.0 * (truth["energy.C10"] + 2.0 * truth["energy.C20"] * (i1 - 3.0)) * (1.0 - i1 / (3.0 * l**2))
    g = truth.get("fraction", 0.0)
    stress = elastic
    if g:
        step = np.diff(time)[:, None] / truth["tau"]
        h = np.zeros_like(elastic)
        for n in range(len(time) - 1):
            decay = np.exp(-step[n])
            h[n + 1] = decay * h[n] + g * (1.0 - decay) / step[n] * (elastic[n + 1] - elastic[n])
        stress = (1.0 - g) * elastic + h
    return (l[:, 0] ** 2 * stress[:, 0] - l[:, 2] ** 2 * stress[:, 2]) / l[:, 0]


def write(path: Path, name: str, truth: dict[str, float], seed: int) -> None:
    """One sample as a recording file, version 1."""
    rng = np.random.default_rng(seed)
    with h5py.File(path, "w") as file:
        file.attrs.update(format="tissue-recording", version=1, sample=name, density=1060.0)
        file.attrs["source"] = "data/make_demo.py, closed forms"
        group = file.create_group("recordings", track_order=True)
        for k, (test, kind, corners) in enumerate(TESTS):
            at, to = np.array(corners, float).T
            # Ten times finer inside, so that the branch sees the true path and not the sampling.
            fine = np.linspace(at[0], at[-1], 10 * (SAMPLES - 1) + 1)
            stress = nominal_stress(kind, fine, np.interp(fine, at, to), truth)[::10]
            time = fine[::10]
            own = group.create_group(test)
            own.attrs.update(experiment=kind, start=300.0 * k, height=HEIGHT, area=np.pi * DIAMETER**2 / 4)
            own["time"], own["stretch"] = time, np.interp(time, at, to)
            own["nominal_stress"] = stress + truth["noise_std"] * rng.standard_normal(len(time))
            own["nominal_stress"].attrs["noise_std"] = truth["noise_std"]


def main(folder: Path) -> None:
    """Both samples, what is true of them, and the checksums."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed, (name, truth) in enumerate(TRUTH.items(), start=2012):
        write(folder / f"{name}.h5", f"demo-{name}", truth, seed)
    (folder / "truth.json").write_text(json.dumps(TRUTH, indent=2) + "\n")
    made = sorted(p for p in folder.iterdir() if p.suffix in (".h5", ".json"))
    sums = "".join(f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.name}\n" for p in made)
    (folder / "SHA256SUMS").write_text(sums)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "demo")

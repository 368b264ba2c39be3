"""Samples of the panel, built from raw tables as `causes.toml` says: one function a protocol, thinned by row only."""

import csv
import functools
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.errors import InputError
from tissuejax.recordings.files import read_all
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.recordings.specimens import NO_TIME

FITS = Path(__file__).resolve().parents[1]
LIVER_DEPTH, BALL = 0.020, 4.0e-3  # m: stand-in thickness of the liver, radius of the ball
SITES = 6
PLATE = 8.0e-3  # m: diameter of the fungal cylinders

KEPT = (
    "verdict",
    "confidence",
    "reasons",
    "effects",
    "best_attempt",
    "alternatives",
    "explained",
    "rest",
    "warnings",
    "fitted",
    "held_out",
    "before",
    "after",
    "probabilities",
    "inclusion",
    "something_missing",
    "used",
)


@dataclass(frozen=True)
class Entry:
    """One sample of the panel.

    Attributes:
        id: its name.
        key: protocol.
        tests: what it is made from.
        energy, ogden_form: base model.
        samples: rows at most, of each recording.
        held: recordings that no fit reads; None if there is one recording only.
    """

    id: str
    key: str
    tests: tuple[str, ...]
    energy: str
    ogden_form: str | None
    samples: int
    held: str | None


def entries(causes: dict) -> list[Entry]:
    """Every specimen line of causes.toml with what its protocol says."""
    return [
        Entry(
            s["id"],
            p["key"],
            tuple(s["tests"]),
            s.get("energy", p.get("energy")),
            p.get("ogden_form"),
            p["samples"],
            s.get("held", p.get("held")),
        )
        for p in causes["protocol"]
        for s in p["specimens"]
    ]


def file_of(folder: Path, name: str, kind: str = "results") -> Path:
    """Where the result of a sample lies, or (in "runs") its evidence."""
    return folder / kind / f"{''.join(c if c.isalnum() else '-' for c in name)}.json"


def recordings_folder() -> Path:
    """Where the recordings lie.

    Raises:
        InputError: not there.
    """
    shared = Path(os.environ.get("TISSUEJAX_SHARED", FITS.parents[1] / "shared"))
    if not (shared / "recordings").is_dir():
        raise InputError(f"{shared / 'recordings'} is not here: set TISSUEJAX_SHARED to the folder that holds it")
    return shared / "recordings"


def build(entry: Entry) -> tuple[Sample, tuple[str, ...] | None]:
    """The sample, and the recordings held out (None: there is nothing that could be)."""
    whole = MAKERS[entry.key](entry.tests)
    sample = replace(whole, name=entry.id, recordings={n: thin(r, entry.samples) for n, r in whole.recordings.items()})
    names = tuple(sample.recordings)
    if entry.held is None:
        return sample, None
    if entry.held == "none":
        return sample, ()
    if entry.held == "last":
        return sample, names[-1:] if len(names) > 1 else None
    held = tuple(n for n in names if n == entry.held or entry.held in n.split())
    if not held:
        raise InputError(f"{entry.id}: no recording {entry.held!r} to hold out; it has {', '.join(names)}")
    return sample, held


def thin(r: Recording, most: int) -> Recording:
    """Rows spread evenly over the recording, the first and the last among them."""
    time = np.asarray(r.inputs["time"])
    keep = np.unique(np.linspace(0, len(time) - 1, min(most, len(time))).round().astype(int))
    return rows(r, keep)


def rows(r: Recording, keep: np.ndarray) -> Recording:
    """Only these rows."""
    inputs = {k: np.asarray(v)[keep] for k, v in r.inputs.items()}
    channels = {
        k: Channel(np.asarray(c.time)[keep], np.asarray(c.values)[keep], c.unit, c.noise_std)
        for k, c in r.channels.items()
    }
    return replace(r, inputs=inputs, channels=channels)


def quiet(r: Recording) -> Recording:
    """Without a stated noise: what the table calls one is the spread between specimens."""
    return replace(r, channels={k: Channel(c.time, c.values, c.unit, None) for k, c in r.channels.items()})


def uniaxial(name: str, time, stretch, stress, **size: float) -> Recording:
    """A uniaxial recording; time from its first sample, nominal stress in Pa, `size` in m and m^2."""
    time = np.asarray(time, float) - time[0]
    channels = {"nominal_stress": Channel(time, np.asarray(stress, float), "Pa", None)}
    return Recording(name, "uniaxial", {"time": time, "stretch": np.asarray(stretch, float)}, channels, size)


@functools.lru_cache
def side_file(path: str) -> dict[str, Sample]:
    """All samples of a side file of another study."""
    return read_all(FITS / path)


@functools.lru_cache
def table(path: str) -> list[dict[str, str]]:
    """Rows of a table of the recordings."""
    with (recordings_folder() / path).open() as file:
        return list(csv.DictReader(file))


def column(path: str, *names: str) -> np.ndarray:
    """Columns of a table as numbers, (rows, names)."""
    return np.array([[float(row[n]) for n in names] for row in table(path)])


def beef(tests: tuple[str, ...]) -> Sample:
    """One ramp and hold, as an effective compression."""
    return side_file("beef/relaxation.toml")[tests[0]]


def ecoflex(tests: tuple[str, ...]) -> Sample:
    """Compressions of one material."""
    material = tests[0].rsplit("_", 1)[0]
    whole = side_file("ecoflex/ecoflex.toml")[material]
    return replace(whole, recordings={t: whole.recordings[t] for t in tests})


def ecoflex_halves(tests: tuple[str, ...]) -> Sample:
    """Odd and even rows of one compression."""
    (test,) = ecoflex(tests).recordings.values()
    n = np.arange(len(np.asarray(test.inputs["time"])))
    halves = {f"{k} rows": replace(rows(test, n[n % 2 == i]), name=f"{k} rows") for i, k in enumerate(("odd", "even"))}
    return replace(ecoflex(tests), recordings=halves)


def specimen(test: str) -> dict[str, str]:
    """The foam's row of sizes."""
    return next(row for row in table("foam-compressibility/specimens.csv") if row["test_id"] == test)


def foam_compression(tests: tuple[str, ...]) -> Sample:
    """Cycles between plates and the hold after them."""
    found = {}
    for test in tests:
        t, gap, force = column(f"foam-compressibility/compression/{test}.csv", "time_s", "gap_mm", "force_N").T
        size = specimen(test)
        area, diameter = 1e-6 * float(size["area_mm2"]), 1e-3 * float(size["diameter_mm"])
        found[test] = uniaxial(test, t, gap / gap[0], -force / area, area=area, diameter=diameter, height=1e-3 * gap[0])
    return Sample(tests[0], found)


def foam_tension(tests: tuple[str, ...]) -> Sample:
    """Six cycles to 30 % and six to 200 %, without the pull to failure."""
    (test,) = tests
    t, x, force = column(f"foam-compressibility/tension/{test}.csv", "time_s", "displacement_mm", "force_N").T
    size = specimen(test)
    strain, area = x / float(size["gauge_length_mm"]), 1e-6 * float(size["area_mm2"])
    height = 1e-3 * float(size["gauge_length_mm"])
    jumps = np.diff(np.concatenate([[0], (strain > 1.5).astype(int), [0]]))
    begins, ends = np.flatnonzero(jumps == 1), np.flatnonzero(jumps == -1)  # of the visits above 150 %
    end = ends[5] + np.argmin(strain[ends[5] : begins[6] if len(begins) > 6 else None])
    return Sample(
        test,
        {test: uniaxial(test, t[: end + 1], 1 + strain[: end + 1], force[: end + 1] / area, area=area, height=height)},
    )


def foam_lateral(tests: tuple[str, ...]) -> Sample:
    """Axial and lateral stretch in compression as a biaxial test whose second stress is nothing."""
    path = f"foam-compressibility/means/{tests[0]}-tension-compression-mean.csv"
    axial, lateral, stress = column(path, "axial_stretch", "lateral_stretch", "nominal_stress_kPa").T
    here = np.flatnonzero((axial <= 1.0) & (axial > 0.45))[::-1]
    time = np.arange(len(here), dtype=float)
    P = np.stack([1e3 * stress[here], np.zeros(len(here))], -1)
    inputs = {"time": time, "stretch": np.stack([axial[here], lateral[here]], -1)}
    r = Recording("compression", "biaxial", inputs, {"nominal_stress": Channel(time, P, "Pa", None)}, {})
    return Sample(tests[0], {"compression": r}, notes=NO_TIME)


def fungi(tests: tuple[str, ...]) -> Sample:
    """Two strokes at each rate, a specimen each."""
    found, area = {}, np.pi * PLATE**2 / 4
    for test in tests:
        t, gap, force = column(f"fungi-steak-rates/tests/{test}.csv", "time_s", "gap_mm", "force_N").T
        found[test] = uniaxial(test, t, gap / gap[0], -force / area, area=area, diameter=PLATE, height=1e-3 * gap[0])
    return Sample(tests[0], found)


def brain_modes(tests: tuple[str, ...]) -> Sample:
    """Tension, compression and shear of a region."""
    return side_file("human-brain/brain.toml")[tests[0]]


def brain_compound(tests: tuple[str, ...]) -> Sample:
    """Shear at fixed axial stretches; recordings named as in the table."""
    whole = side_file("human-brain/brain-compound-shear.toml")["corona-radiata"]
    named = {f"{n.split()[-1].replace('.', 'd')}": r for n, r in whole.recordings.items()}
    return replace(whole, recordings={t: replace(named[t], name=t) for t in tests})


def brain_failure(tests: tuple[str, ...]) -> Sample:
    """One pull to failure."""
    return side_file("human-brain/brain-to-failure.toml")[tests[0]]


def muscle(tests: tuple[str, ...]) -> Sample:
    """Four ramps and holds of one state; the table's deviation is the spread between fibres and no noise."""
    whole = side_file("muscle-fibre/fibre.toml")[tests[0]]
    return replace(whole, recordings={n: quiet(r) for n, r in whole.recordings.items()})


def liver(tests: tuple[str, ...]) -> Sample:
    """The first six sites of a region with ten steps, as effective compressions of a stand-in layer."""
    sites: dict[int, list[tuple[float, float]]] = {}
    for row in table("pig_liver_robot_probing/probing_points.csv"):
        if row["region"] == tests[0]:
            sites.setdefault(int(row["site"]), []).append((float(row["depth_mm"]), float(row["force_axial_N"])))
    whole = sorted((n, np.array(s)) for n, s in sites.items() if len(s) == 10)[:SITES]
    area, found = np.pi * BALL**2, {}
    for n, s in whole:
        s = s[np.argsort(s[:, 0])]
        name = f"site {n}"
        found[name] = uniaxial(
            name, np.arange(10.0), 1 - 1e-3 * s[:, 0] / LIVER_DEPTH, -s[:, 1] / area, area=area, height=LIVER_DEPTH
        )
    return Sample(tests[0], found, notes=NO_TIME)


def skin(tests: tuple[str, ...]) -> Sample:
    """Five biaxial paths."""
    return tj.read(FITS / "porcine-skin/skin.toml")


def tendon(tests: tuple[str, ...]) -> Sample:
    """One ramp and hold."""
    return side_file("rat-tail-tendon/tendon.toml")[tests[0]]


def rubber(tests: tuple[str, ...]) -> Sample:
    """Three modes of one source."""
    return side_file("rubber/rubber.toml")[tests[0]]


def rubber_halves(tests: tuple[str, ...]) -> Sample:
    """Odd rows of all modes, and the even rows of one."""
    whole, found = rubber(tests), {}
    for name, r in whole.recordings.items():
        n = np.arange(len(np.asarray(r.inputs["time"])))
        found[name] = rows(r, n[n % 2 == 0])
        if name == "planar":
            found["planar, even rows"] = replace(rows(r, n[n % 2 == 1]), name="planar, even rows")
    return replace(whole, recordings=found)


MAKERS: dict[str, Callable[[tuple[str, ...]], Sample]] = {
    "beef": beef,
    "ecoflex": ecoflex,
    "ecoflex-halves": ecoflex_halves,
    "foam-compression": foam_compression,
    "foam-tension": foam_tension,
    "foam-lateral": foam_lateral,
    "fungi-rates": fungi,
    "fungi-slow": fungi,
    "brain-modes": brain_modes,
    "brain-compound": brain_compound,
    "brain-failure": brain_failure,
    "muscle": muscle,
    "liver-sites": liver,
    "skin": skin,
    "tendon": tendon,
    "rubber": rubber,
    "rubber-halves": rubber_halves,
}

"""The work of tabulating: sites computed side by side and kept one by one, refined until the error is small enough."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jax
import numpy as np

from tissuejax.energies.catalogue import forms_of, name_of
from tissuejax.errors import InputError
from tissuejax.experiments import workers
from tissuejax.progress import Progress, Silent
from tissuejax.storage import plain, write_npz
from tissuejax.surrogate import error
from tissuejax.surrogate.memory import narrow
from tissuejax.surrogate.places import Box, checked, first_contact
from tissuejax.surrogate.ramp import Matter, Ramp, ramp
from tissuejax.surrogate.refusals import refuse
from tissuejax.surrogate.site_mesh import GRADING, Grid, geometry
from tissuejax.surrogate.surrogate import Surrogate
from tissuejax.surrogate.tabulate import full_scene, summary, surrogate

BOX_MESH, TOP_MESH = (22, 22, 8), (16, 16, 6)  # elements of a site: for a box; for a whole top, in half the time
HELD_OUT, LEVELS = 6, (0.45, 0.7, 0.9, 1.0)  # places, and shares of the greatest depth, at which the error is measured
MOST_DEPTHS = 33  # sites along an axis
HELPS = 0.9  # a halved spacing that leaves more than this share of the error does not help: something else is coarse
SILENT = Silent()


@dataclass(frozen=True, eq=False)
class Precomputed:
    """A surrogate and what is known of it: `record` goes into the file (model, box, errors, hashes)."""

    surrogate: Surrogate
    record: dict
    cells: np.ndarray = field(repr=False)


def precompute(
    matter: Matter,
    box: Box,
    grid: Grid | None = None,
    wanted: float | None = None,
    keep: Path | None = None,
    progress: Progress = SILENT,
    processes: int = 2,
    numerical: bool = True,
) -> Precomputed:
    """Tabulate a model over a box.

    Args:
        wanted: greatest held-out error of the force (0.01 is 1 %); sites are added until it is reached. None: as it is.
        keep: folder for finished sites: a run that was stopped goes on from there.
        numerical: whether the full model's own error is measured too (two more ramps).

    Raises:
        InputError: a box or depth the organ doesn't hold, an effect that can't be tabulated, an error that is not
            reached or can't be measured.
        NotConverged: statics failed at some place and depth; finished sites are kept.
    """
    grid = grid or Grid(BOX_MESH, matter.radius)
    if wanted is not None and not 0 < wanted < np.inf:
        raise InputError(f"--error {100 * wanted:g}: wanted is a percentage over 0, e.g. --error 1")
    checked(box, matter.lobe, matter.radius)
    middle = (box.low + box.high) / 2
    refuse(matter, grid, middle)
    true = full_scene(matter, grid, middle)
    prony = None
    if true.tissue.prony is not None and float(np.abs(true.tissue.prony.g).max()) > 0:
        prony = (np.asarray(true.tissue.prony.g), np.asarray(true.tissue.prony.tau))
        narrow(box)
    contact = first_contact(matter.lobe, box, float(true.probe.shape.radius))
    run = _Sites(matter, grid, contact, keep, processes, progress, prony is not None)
    checks = box.depth * np.asarray(LEVELS)
    tests = run.all(box.held_out(HELD_OUT), checks, "held-out places", fields=False)
    felt = max(float(np.linalg.norm(r.force, axis=1).max()) for r in tests)
    if wanted is not None and felt <= error.FELT:
        raise InputError(
            f"--error {100 * wanted:g}: the greatest held-out force is {felt:.3f} N, and errors are stated for forces "
            f"over {error.FELT:g} N: take a larger --depth, or leave --error out"
        )
    rounds = []
    while True:
        ramps = run.all(box.sites().reshape(-1, 2), box.levels, f"{box.counts[0]} x {box.counts[1]} sites")
        workers.release()  # the tables are made by this process alone
        made = surrogate(matter, box, grid, ramps, prony)
        found = error.held_out(made, tests)
        rounds.append({"sites": list(box.counts)} | found)
        if wanted is None or found["force_worst"] <= wanted:
            break
        box = _refined(box, rounds, wanted)
    own = None
    if numerical:
        del ramps, tests
        run.close()
        with progress.stage("numerical error of the full model", 1) as stage:
            own = error.numerical(matter, grid, middle, float(contact.sample(middle[None])[0, 0]), checks)
            stage.advance()
    record = {
        "model": described(matter),
        "box": {
            "low_m": list(map(float, box.low)), "high_m": list(map(float, box.high)), "depth_m": float(box.depth),
            "sites": list(box.counts), "depths": box.depths,
        },
        "radius_m": float(true.probe.shape.radius),
        "mesh": list(grid.counts),
        "error": found,
        "rounds": rounds,
        "numerical": own,
        **summary(made),
    }  # fmt: skip
    return Precomputed(made, record, geometry(matter.lobe, middle, grid).cells)


def _refined(box: Box, rounds: Sequence[dict], wanted: float) -> Box:
    """The box with half the spacing between its sites.

    Raises:
        InputError: halving the spacing did not help the last time, or there are too many sites.
    """
    nx, ny = box.counts
    error = rounds[-1]["force_worst"]
    said = f"the error at held-out places is {100 * error:.2g} % with {nx} x {ny} sites, wanted is {100 * wanted:g} %"
    if len(rounds) > 1 and error > HELPS * rounds[-2]["force_worst"]:
        raise InputError(
            f"{said}, and was {100 * rounds[-2]['force_worst']:.2g} % with half as many along each side: places are "
            f"close enough, take more --depths (here {box.depths}), a finer --mesh, or allow more --error"
        )
    if max(box.refined().counts) > MOST_DEPTHS:
        raise InputError(f"{said}: take a smaller --reach or allow more --error")
    return box.refined()


def described(matter: Matter) -> dict:
    """The model by names and values."""
    model = matter.model
    return {
        "energy": name_of(model.energy),
        "formula": model.energy.formula,
        "forms": forms_of(model.energy, model.volumetric),
        "volumetric": None if model.volumetric is None else name_of(model.volumetric),
        "effects": [effect.name for effect in model.effects],
        "values": {k: float(v) for k, v in matter.values.items()},
        "density": matter.density,
    }


def fingerprint(matter: Matter, grid: Grid) -> str:
    """Hash of everything that the states of a site follow from, except the site."""
    fine = np.linspace(0, 1, 17)
    shape = b"".join(np.ascontiguousarray(np.round(f(fine, fine), 9)).tobytes() for f in matter.lobe)
    text = json.dumps(plain([described(matter), matter.radius, grid, GRADING, repr(matter.settings)]), sort_keys=True)
    return hashlib.sha256(text.encode() + shape).hexdigest()


class _Sites:
    """Ramps of many sites, kept in a folder where one is named."""

    def __init__(self, matter, grid, contact, keep, processes, progress, fields):
        self.matter, self.grid, self.contact, self.fields = matter, grid, contact, fields
        self.keep, self.processes, self.progress = keep, processes, progress
        self.known: dict[str, Ramp] = {}
        self.hash = fingerprint(matter, grid)

    def all(self, places: Sequence, depths, what: str, fields: bool | None = None) -> list[Ramp]:
        """The ramps at these places."""
        fields = self.fields if fields is None else fields
        keys = [self._key(p, depths, fields) for p in places]
        missing = [i for i, k in enumerate(keys) if not self._load(k)]
        with self.progress.stage(what, len(places)) as stage:
            stage.advance(len(places) - len(missing), "kept from before" if len(missing) < len(places) else "")
            size = 2 * max(1, self.processes)
            for first in range(0, len(missing), size):
                some = missing[first : first + size]
                height = self.contact.sample(np.array([places[i] for i in some]))[:, 0]
                jobs = [
                    (
                        self.matter,
                        self.grid,
                        np.asarray(places[i]),
                        float(h),
                        np.asarray(depths),
                        fields,
                        self._file(keys[i]),
                    )
                    for i, h in zip(some, height)
                ]
                for i, done in zip(some, workers.run_all(jobs, self.processes, one_site)):
                    self.known[keys[i]] = Ramp(*done)
                    stage.advance()
        return [self.known[k] for k in keys]

    def close(self) -> None:
        """Give back the memory of states and compiled programs: the finer mesh of the numerical error needs as much."""
        self.known.clear()
        jax.clear_caches()
        workers.trim()

    def _key(self, place, depths, fields) -> str:
        text = f"{self.hash} {np.round(place, 9).tolist()} {np.round(depths, 9).tolist()} {fields}"
        return hashlib.sha256(text.encode()).hexdigest()[:24]

    def _file(self, key: str) -> Path | None:
        return None if self.keep is None else Path(self.keep) / f"site-{key}.npz"

    def _load(self, key: str) -> bool:
        file = self._file(key)
        if key not in self.known and file is not None and file.is_file():
            with np.load(file) as found:
                self.known[key] = Ramp(**{name: found[name] for name in Ramp._fields})
        return key in self.known


def one_site(matter: Matter, grid: Grid, place, contact: float, depths, fields: bool, file: Path | None) -> tuple:
    """One site, kept as soon as it is there; runs in any process."""
    found = ramp(matter, grid, place, contact, depths, fields)
    slim = found._replace(strain=found.strain.astype(np.float32), stress=found.stress.astype(np.float32))
    if file is not None:
        write_npz(file, slim._asdict())
    workers.trim()
    return tuple(slim)

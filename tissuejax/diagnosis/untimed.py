"""Recordings without a clock: what happens in time can't be asked for.

Tables of stress against stretch carry no time; samples are then taken as one second apart. A drift of the sensor or a
relaxation time would be a function of the row number, and could bend to any curve: such candidates are left out.
"""

from collections.abc import Mapping
from dataclasses import replace

from tissuejax.diagnosis.bench import Candidate
from tissuejax.recordings.recording import Sample
from tissuejax.recordings.specimens import NO_TIME

TIMED = {
    "viscoelasticity": None,
    "periodic": None,
    "aging": None,
    "clock-lag": None,
    "drift": ("rate", "settling"),
    "compressibility": ("drained", "time"),
}  # effects that need a clock, or the parameters of them that do


def timed(sample: Sample) -> bool:
    """Whether the sample's recordings have times of their own."""
    return NO_TIME not in sample.notes


def without_clock(candidates: Mapping[str, Candidate]) -> dict[str, Candidate]:
    """Candidates that mean something without a clock; of effects that partly do, what is left of them."""
    kept: dict[str, Candidate] = {}
    for key, c in candidates.items():
        need = TIMED.get(c.name, ())
        if need is None:
            continue
        amplitudes, shapes, held = (
            [p for p in paths if not _any(p, need)] for paths in (c.amplitudes, c.shapes, c.held)
        )
        same = any(
            (k.name, k.amplitudes, k.shapes) == (c.name, tuple(amplitudes), tuple(shapes)) for k in kept.values()
        )
        if not amplitudes or same:
            continue
        grid = tuple({p: v for p, v in g.items() if not _any(p, need)} for g in c.grid)
        once = tuple({tuple(sorted(g.items())): g for g in grid}.values())
        kept[key] = replace(c, amplitudes=tuple(amplitudes), shapes=tuple(shapes), held=tuple(held), grid=once)
    return {k: replace(c, beside=tuple(b for b in c.beside if b in kept)) for k, c in kept.items()}


def _any(path: str, names: tuple[str, ...]) -> bool:
    return path.split(".")[2] in names

"""Recordings without a clock, or with one that says nothing: what happens in time can't be asked for.

Tables of stress against stretch carry no time; samples are then taken as one second apart. A drift of the sensor or a
relaxation time would be a function of the row number, and could bend to any curve. A ramp at one rate without a hold
has a clock, but its time is a function of the strain: what goes slowly with it is a strain energy. Such candidates are
left out.
"""

from collections.abc import Mapping, Set
from dataclasses import replace

from tissuejax.diagnosis.bench import Candidate
from tissuejax.effects.catalogue import effects


def without_clock(candidates: Mapping[str, Candidate]) -> dict[str, Candidate]:
    """Candidates that mean something without a clock; of effects that partly do, what is left of them."""
    known = effects("homogeneous")
    acting = {name for name, effect in known.items() if effect.needs.get("homogeneous") in ("rates", "times")}
    still = {k: c for k, c in candidates.items() if c.name not in acting}
    return without(still, {(name, p) for name, effect in known.items() for p in effect.timed})


def without_pace(candidates: Mapping[str, Candidate]) -> dict[str, Candidate]:
    """Candidates that are no strain energy where time goes with strain; of effects that partly are, what is left."""
    return without(candidates, {(name, p) for name, effect in effects("homogeneous").items() for p in effect.slow})


def without(candidates: Mapping[str, Candidate], parameters: Set[tuple[str, str]]) -> dict[str, Candidate]:
    """What is left of candidates if these parameters (effect, name) stay neutral."""
    kept: dict[str, Candidate] = {}
    for key, c in candidates.items():
        amplitudes, shapes, held = (_left(paths, parameters) for paths in (c.amplitudes, c.shapes, c.held))
        same = any((k.name, k.amplitudes, k.shapes) == (c.name, amplitudes, shapes) for k in kept.values())
        if c.amplitudes and (not amplitudes or same):
            continue
        grid = tuple({p: g[p] for p in _left(tuple(g), parameters)} for g in c.grid)
        once = tuple({tuple(sorted(g.items())): g for g in grid}.values())
        kept[key] = replace(c, amplitudes=amplitudes, shapes=shapes, held=held, grid=once)
    return {k: replace(c, beside=tuple(b for b in c.beside if b in kept)) for k, c in kept.items()}


def _left(paths: tuple[str, ...], parameters: Set[tuple[str, str]]) -> tuple[str, ...]:
    """Paths `effects.NAME.PARAMETER...` of other parameters than these."""
    return tuple(p for p in paths if tuple(p.split(".")[1:3]) not in parameters)

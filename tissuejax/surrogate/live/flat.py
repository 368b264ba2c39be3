"""A surrogate's force as one flat little-endian file, for `tissuejax_force.h`: any language reads it in a few lines.

Layout: "TJFORCE2"; int32 number of Prony terms, int32 zero; float64 low x, low y, high x, high y, depth, radius,
factor, friction, give, strength, reach, slip[3]; float64 g[8], tau[8]; then the tables touch (over x, y), law, and with
a memory stress and strain (over x, y, s): int32 counts of coefficients along x, y, s, int32 values M, float64
origin[3], 1 / spacing[3], coefficients with M fastest. `strength` is that of
`Surrogate.strength`.
"""

from pathlib import Path

import numpy as np

from tissuejax.errors import InputError
from tissuejax.storage import write_bytes
from tissuejax.surrogate.cardinal import Table
from tissuejax.surrogate.surrogate import Surrogate

MAGIC, TERMS, MODES = b"TJFORCE2", 8, 64


def flat(surrogate: Surrogate) -> bytes:
    """The file's bytes.

    Raises:
        InputError: more relaxation terms than the format holds.
    """
    s, memory = surrogate, surrogate.memory
    g = np.zeros(0) if memory is None else np.asarray(memory.g)
    tau = np.zeros(0) if memory is None else np.asarray(memory.tau)
    if len(g) > TERMS:
        raise InputError(f"{len(g)} relaxation terms: a force file holds {TERMS}; precompute a model with fewer")
    numbers = [
        *np.asarray(s.low), *np.asarray(s.high), s.depth, s.radius, s.factor,
        s.rub.friction, s.rub.give, s.strength(), max(float(s.rub.reach), 1e-9), *np.asarray(s.rub.slip),
    ]  # fmt: skip
    parts = [
        MAGIC,
        np.array([len(g), 0], "<i4").tobytes(),
        np.array([float(x) for x in numbers], "<f8").tobytes(),
        np.pad(g, (0, TERMS - len(g))).astype("<f8").tobytes(),
        np.pad(tau, (0, TERMS - len(g)), constant_values=1.0).astype("<f8").tobytes(),
        _table(s.touch),
        _table(s.law),
    ]
    if memory is not None:
        parts += [_table(memory.stress), _table(memory.strain)]
    return b"".join(parts)


def write(surrogate: Surrogate, path: str | Path) -> Path:
    """Write the file atomically."""
    return write_bytes(path, flat(surrogate))


def _table(table: Table) -> bytes:
    c = np.asarray(table.coefficients, float)
    axes = c.ndim - 1
    counts = [*c.shape[:-1], *([1] * (3 - axes)), c.shape[-1]]
    origin = np.pad(np.asarray(table.origin, float), (0, 3 - axes))
    per = np.pad(1 / np.asarray(table.spacing, float), (0, 3 - axes), constant_values=1.0)
    return np.array(counts, "<i4").tobytes() + np.concatenate([origin, per, c.ravel()]).astype("<f8").tobytes()

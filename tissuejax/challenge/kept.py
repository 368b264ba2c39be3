"""What a diagnosed model says of a recording that nothing has read: asked of the model under test, scored elsewhere."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float


def foretold(found: Any, path: Path, energy: str, kept: Path) -> Float[np.ndarray, "n ..."]:
    """Stress that the repaired model predicts for the recording kept back, Pa.

    Args:
        found: the diagnosis of the case.
        path: the case's file.
        energy: base model told to the diagnosis.
        kept: a file that holds what is done in the recording, and no stress.
    """
    from tissuejax.diagnosis.material import MaterialBench
    from tissuejax.energies.catalogue import energy as named_energy
    from tissuejax.recordings.files import read

    whole, extra = read(path), read(kept)
    sample = replace(whole, recordings={**whole.recordings, **extra.recordings})
    names, last = tuple(whole.recordings), tuple(extra.recordings)
    values = found.verdict.chosen.all
    effects = sorted({p.split(".")[1] for p in values if p.startswith("effects.")})
    noise = dict.fromkeys((*names, *last), 1.0)
    bench = MaterialBench.of(sample, named_energy(energy), names, last, noise, effects, sizes=found.search.bench.sizes)
    prediction = bench.predict(values, last)
    columns = [prediction[s.rows] for s in bench.segments if s.recording in last]
    return columns[0] if len(columns) == 1 else np.stack(columns, -1)

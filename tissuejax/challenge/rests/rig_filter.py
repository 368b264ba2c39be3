"""A filter in the rig's software: the recorded force is a low-pass of the true one and comes late."""

import numpy as np

from tissuejax.challenge.rests.rest import History, Record, Rest


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """First-order low-pass of the stress, one time constant for the sample, less the stress."""
    tau, out = float(rng.uniform(0.15, 0.6)), []
    for r in records:
        passed = np.array(r.stress, float)
        for i, dt in enumerate(np.diff(r.trial.time)):
            passed[i + 1] = r.stress[i + 1] + (passed[i] - r.stress[i + 1]) * np.exp(-dt / tau)
        out.append(passed - r.stress)
    return out


REST = Rest("rig-filter", "the rig's software filters the force", change, ("clock-lag",))

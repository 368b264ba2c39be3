"""What data a fit was made of, as one short text: two fits with the same one can be compared."""

import hashlib

import numpy as np

from tissuejax.estimation.problem import Problem


def fingerprint(problem: Problem) -> str:
    """A hash over the fitted channels: names, times, what was done, what was measured, and the noise where recorded.

    The model takes no part in it, nor does a noise level that was estimated from its residuals.
    """
    seen = hashlib.sha256()

    def take(name: str, array) -> None:
        array = np.ascontiguousarray(np.asarray(array, float))
        seen.update(f"{name} {array.shape}\n".encode() + array.tobytes())

    recordings = problem.predictor.sample.recordings
    for recording, channel in sorted(problem.channels):
        key, series = f"{recording}/{channel}", recordings[recording].channels[channel]
        take(f"{key} time", series.time)
        take(f"{key} values", series.values)
        for name, drive in sorted(recordings[recording].inputs.items()):
            take(f"{key} {recordings[recording].experiment} {name}", drive)
        take(f"{key} noise", np.nan if key in problem.noise.groups else problem.noise.std[key])
    seen.update(problem.loss.encode())
    return seen.hexdigest()[:32]

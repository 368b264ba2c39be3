"""Recordings as CSV: what was done and every channel, one file a recording and clock, units in the header."""

import csv
import io
from pathlib import Path

import numpy as np

from tissuejax.recordings.recording import Recording
from tissuejax.storage import write_text

AXES = "xyz"


def write_table(recording: Recording, folder: Path, other: Recording | None = None) -> list[Path]:
    """One CSV for every channel: time, what was done at these times, values, and `other`'s values beside them."""
    written = []
    for name, channel in recording.channels.items():
        time = np.asarray(channel.time, float)
        columns = {"time (s)": time}
        for key in ("stretch", "shear"):
            drive = recording.inputs.get(key)
            if drive is not None and len(drive) == len(time):
                columns |= _columns(key, np.asarray(drive, float), "1")
        columns |= _columns(name, np.asarray(channel.values, float), channel.unit)
        if other is not None and name in other.channels:
            columns |= _columns(f"{name} measured", np.asarray(other.channels[name].values, float), channel.unit)
        text = io.StringIO()
        writer = csv.writer(text)
        writer.writerow(columns)
        writer.writerows(zip(*([f"{x:.9g}" for x in column] for column in columns.values()), strict=True))
        written.append(write_text(folder / f"{recording.name}-{name}.csv", text.getvalue()))
    return written


def _columns(name: str, values: np.ndarray, unit: str) -> dict[str, np.ndarray]:
    flat = values.reshape(len(values), -1)
    if flat.shape[1] == 1:
        return {f"{name} ({unit})": flat[:, 0]}
    if values.ndim == 3:
        labels = [f"{k + 1}{AXES[a]}" for k in range(values.shape[1]) for a in range(3)]
    else:
        labels = list(AXES) if flat.shape[1] == 3 else [str(k + 1) for k in range(flat.shape[1])]
    return {f"{name} {label} ({unit})": column for label, column in zip(labels, flat.T, strict=True)}

"""C3D: motion capture's binary file (Qualisys, Vicon, OptiTrack ...), read by the package `c3d`."""

import warnings
from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked


class C3D(MarkerExport):
    """Labelled points at an even rate; a negative residual marks a lost point."""

    name: ClassVar[str] = "c3d"
    program: ClassVar[str] = "C3D motion capture"
    basis: ClassVar[str] = "a real file (Qualisys)"

    def recognises(self, path: Path, head: str) -> bool:
        """By its ending and the key byte 0x50 at the second place."""
        return path.suffix.lower() == ".c3d" and head[1:2] == "P"

    def read(self, path: Path) -> Tracked:
        """Points, the unit that the file declares, times from its rate."""
        import c3d

        try:
            with open(path, "rb") as file, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                reader = c3d.Reader(file)
                frames = [points[:, :4].astype(float) for _, points, _ in reader.read_frames()]
                labels = tuple(str(label).strip() for label in reader.point_labels)
                rate, unit = float(reader.point_rate), _unit(reader)
        except (ValueError, AssertionError, EOFError, KeyError, IndexError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: found a C3D file that can't be read ({error}); export it again") from error
        if not frames or not len(frames[0]) or rate <= 0:
            raise InputError(f"{path}: found a C3D file without frames of points; export it again")
        data = np.stack(frames)
        position = np.where(data[..., 3:] < 0, np.nan, data[..., :3])
        assumed = () if unit else ("the file names no unit of length",)
        return Tracked(np.arange(len(data)) / rate, position, labels, unit, assumed)


def _unit(reader) -> str:
    parameter = reader.get("POINT:UNITS")
    return str(parameter.string_value).strip() if parameter is not None else ""

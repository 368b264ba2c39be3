"""Ncorr inside MultiDIC: MATLAB 7.3 files (HDF5 behind a header) of image points of a pair of cameras.

`DIC2DpairResults.Points` holds one array (points, 2) for each image of each camera, in pixels: the first half is the
reference camera. To get points in space the pair has to be reconstructed in MultiDIC; here one camera's view is given.
"""

from pathlib import Path
from typing import ClassVar

import h5py
import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked

_GROUP = "DIC2DpairResults"


class Ncorr(MarkerExport):
    """Result of Ncorr on a pair of cameras; MATLAB's arrays are stored transposed."""

    name: ClassVar[str] = "ncorr"
    program: ClassVar[str] = "Ncorr (MultiDIC)"
    basis: ClassVar[str] = "a real file (five images of two cameras)"

    def recognises(self, path: Path, head: str) -> bool:
        """A MATLAB 7.3 file with that struct."""
        if not head.startswith("MATLAB 7.3"):
            return False
        try:
            with h5py.File(path, "r") as file:
                return _GROUP in file
        except OSError:
            return False

    def read(self, path: Path) -> Tracked:
        """Every image of the reference camera: one frame each, pixels, no time.

        Raises:
            InputError: a file whose parts don't fit together.
        """
        try:
            with h5py.File(path, "r") as file:
                group = file[_GROUP]
                if not isinstance(group, h5py.Group):
                    raise TypeError(f"{_GROUP} is no group")
                images = int(np.asarray(group["nImages"])[0, 0])
                camera = int(np.asarray(group["nCamRef"])[0, 0])
                references = np.asarray(group["Points"]).ravel()[:images]
                frames = [np.asarray(file[r], float).T for r in references]
                scale = float(np.asarray(group["ncorrInfo/pixtounits"])[0, 0])
                unit = "".join(map(chr, np.asarray(group["ncorrInfo/units"]).ravel()))
        except (OSError, KeyError, IndexError, ValueError, TypeError) as error:
            raise InputError(f"{path}: found a MATLAB file without Ncorr's points ({error}); save it again") from error
        if not frames or any(f.shape != frames[0].shape or f.shape[1] != 2 for f in frames):
            raise InputError(f"{path}: found images with different points, expected the same points in each")
        plane = np.stack(frames) * scale
        position = np.concatenate([plane, np.zeros((*plane.shape[:2], 1))], axis=2)
        labels = tuple(str(k + 1) for k in range(position.shape[1]))
        assumed = (
            f"the view of camera {camera} alone: points in space need the reconstruction of both",
            "y counts downwards",
        )
        return Tracked(None, position, labels, {"pixels": "pixel"}.get(unit, unit), assumed, True)

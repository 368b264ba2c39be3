"""Recordings: what was done to a sample (inputs) and what was measured (channels). SI throughout.

A prediction is a `Recording` too, with the same inputs and predicted channel values, so every plot, table and
error measure serves both.
"""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int


class Channel(eqx.Module):
    """One measured (or predicted) quantity over time.

    Attributes:
        time: sample times, s, strictly increasing.
        values: one row a sample; NaN where a marker was lost.
        unit: SI unit of the values.
        noise_std: standard deviation of the noise per value; None if not recorded.
    """

    time: Float[Array | np.ndarray, " n"]
    values: Float[Array | np.ndarray, "n ..."]
    unit: str = eqx.field(static=True)
    noise_std: float | None = eqx.field(static=True, default=None)


class Recording(eqx.Module):
    """One recording of a sample.

    Attributes:
        name: group name in the file.
        experiment: the kind ("uniaxial", "probing", ...).
        inputs: what was done: "time", "stretch" (n,) or (n,2), "shear"; probing: "probe/time", "probe/position",
            where recorded "contact/time" and "contact/voltage"; cutting: "blade/time", "blade/tip", "depth".
        channels: what was measured: "nominal_stress"; probing: "force" (n,3), "markers" (m,k,3).
        attributes: scalars and small arrays: "start", "area", "height", "diameter", "direction", "probe/radius",
            "stretch/noise_std", "axial_stretch" (simple shear), "blade/thickness", "blade/profile".
    """

    name: str = eqx.field(static=True)
    experiment: str = eqx.field(static=True)
    inputs: Mapping[str, Array | np.ndarray]
    channels: Mapping[str, Channel]
    attributes: Mapping[str, Any] = eqx.field(default_factory=dict)


class Geometry(eqx.Module):
    """The sample's volume mesh as measured, settled on its support (z up, support at z = 0).

    Attributes:
        points: node positions, m.
        cells: node indices, meshio order.
        cell_type: "hexahedron" or "tetra".
        fixed: nodes held by the support.
        surface_points: raw point cloud of the free surface, or None.
    """

    points: Float[np.ndarray, "N 3"]
    cells: Int[np.ndarray, "E k"]
    cell_type: str = eqx.field(static=True)
    fixed: Int[np.ndarray, " F"]
    surface_points: Float[np.ndarray, "S 3"] | None = None


NO_TIME = "No time was recorded: samples are taken as 1 s apart."


class Sample(eqx.Module):
    """One sample: its recordings by name, in file order, and what is known of its body."""

    name: str = eqx.field(static=True)
    recordings: Mapping[str, Recording]
    geometry: Geometry | None = None
    density: float | None = eqx.field(static=True, default=None)
    gravity: tuple[float, float, float] | None = eqx.field(static=True, default=None)
    source: str = eqx.field(static=True, default="")
    notes: str = eqx.field(static=True, default="")

    @property
    def timed(self) -> bool:
        """Whether the recordings have times of their own; else they count samples."""
        return NO_TIME not in self.notes

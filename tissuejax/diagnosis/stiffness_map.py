"""A map of where the data want the tissue stiffer or softer, and what it says of a region.

The misfit falls by gain_e for every unit by which the logarithm of element e's stiffness grows; pictured is its density
over the element's volume. The map locates; contrast and extent come from a refit (a place that nothing can feel stays
white, however wrong it is). Depth is its weak coordinate.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from tissuejax.diagnosis.locate import Located

ONE_SIDED = 0.7  # share of one sign from which a map speaks of a region


@dataclass(frozen=True)
class StiffnessMap:
    """Gain per logarithm of stiffness, of one recording.

    Attributes:
        recording: which one.
        points, cells: the mesh it was computed on, m.
        centres: of the elements, m.
        gain: fall of the misfit (half chi-square) per unit of ln stiffness, of each element.
        density: the same per volume, 1/m^3.
    """

    recording: str
    points: Float[np.ndarray, "N 3"]
    cells: Int[np.ndarray, "E k"]
    centres: Float[np.ndarray, "E 3"]
    gain: Float[np.ndarray, " E"]
    density: Float[np.ndarray, " E"]

    @property
    def sign(self) -> int:
        """+1 where stiffer is wanted in the main, -1 softer."""
        return 1 if self.gain.sum() >= 0 else -1

    @property
    def one_sided(self) -> float:
        """Share of the map that has the main sign."""
        whole = np.abs(self.gain).sum()
        return float(np.maximum(self.sign * self.gain, 0).sum() / whole) if whole > 0 else 0.0

    @property
    def centre(self) -> Float[np.ndarray, "3"]:
        """Centroid of the main sign, m."""
        weight = np.maximum(self.sign * self.gain, 0)
        return weight @ self.centres / max(weight.sum(), 1e-300)

    @property
    def size(self) -> float:
        """Root mean square distance from the centre, m."""
        weight = np.maximum(self.sign * self.gain, 0)
        away = np.sum((self.centres - self.centre) ** 2, axis=1)
        return float(np.sqrt(weight @ away / max(weight.sum(), 1e-300)))


def fitted_region(values: Mapping[str, float], share: float) -> list[Located]:
    """The inclusion of a refit as a place, if there is one: sharper than a map, and with its size."""
    if values.get("effects.inclusion.contrast", 0.0) == 0.0:
        return []
    x, y, z, radius = (values[f"effects.inclusion.{c}"] for c in ("x", "y", "z", "radius"))
    half = radius / values.get("effects.inclusion.flatness", 1.0)
    factor = math.exp(values["effects.inclusion.contrast"])
    what = (
        f"{factor:.2g} times as stiff around ({1e3 * x:.1f}, {1e3 * y:.1f}, {1e3 * z:.1f}) mm, half widths "
        f"{1e3 * radius:.1f} mm across and {1e3 * half:.1f} mm in depth (refit)"
    )
    details = {"centre": [x, y, z], "size": radius, "half_height": half, "unit": "m", "factor": factor}
    return [Located("all", "all", what, min(max(share, 0.0), 1.0), "region", details)]


def regions(maps: list[StiffnessMap]) -> list[Located]:
    """Statements on where the tissue is wanted stiffer or softer, for maps that agree with themselves."""
    whole = sum(np.abs(m.gain).sum() for m in maps) or 1.0
    out = []
    for m in sorted(maps, key=lambda m: -np.abs(m.gain).sum()):
        if m.one_sided < ONE_SIDED:
            continue
        x, y, z = 1e3 * m.centre
        word = "stiffer" if m.sign > 0 else "softer"
        what = f"{word} wanted around ({x:.1f}, {y:.1f}, {z:.1f}) mm, within {1e3 * m.size:.1f} mm"
        share = float(np.abs(m.gain).sum() / whole)
        details = {"centre": m.centre.tolist(), "size": m.size, "unit": "m", "wanted": word}
        out.append(Located("all", m.recording, what, share, "region", details))
    return out

"""The stiffness map on the mesh: where each recording wants the tissue stiffer (blue) or softer (orange)."""

from typing import ClassVar

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.plot import HELD, INK, MODEL, PAPER, Plot, grid

SIGNED = LinearSegmentedColormap.from_list("softer-stiffer", [HELD, PAPER, MODEL])


class DiagnosisMap(Plot):
    """Seen from above (summed over depth) and in a section through the centre of the region."""

    name: ClassVar[str] = "stiffness-map"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 25

    def prepare(self, subject: Diagnosis) -> list[dict] | None:
        """For each map of hexes: outlines in mm with values scaled to 1, from above and in section; the region."""
        maps = [m for m in subject.maps if m.cells.shape[1] == 8 and np.any(m.gain)]
        if not maps:
            return None
        out = []
        for m in maps:
            corners = 1e3 * m.points[m.cells]
            key = np.round(corners[:, :4, :2].mean(1), 6)
            _, first, column = np.unique(key, axis=0, return_index=True, return_inverse=True)
            outline = corners[first][:, [4, 5, 6, 7], :2]
            area = 0.5 * np.abs(
                (outline[:, 2] - outline[:, 0])[:, 0] * (outline[:, 3] - outline[:, 1])[:, 1]
                - (outline[:, 2] - outline[:, 0])[:, 1] * (outline[:, 3] - outline[:, 1])[:, 0]
            )
            above = np.bincount(column.ravel(), m.gain, len(first)) / area
            centre = 1e3 * m.centre
            cut = (corners[:, :, 1].min(1) <= centre[1]) & (corners[:, :, 1].max(1) > centre[1])
            section = corners[cut][:, [0, 1, 5, 4]][:, :, [0, 2]]
            out.append(
                {
                    "recording": m.recording,
                    "above": (outline, above / np.abs(above).max()),
                    "section": (section, m.density[cut] / max(np.abs(m.density[cut]).max(), 1e-300)),
                    "centre": centre,
                    "size": 1e3 * m.size,
                    "one_sided": m.one_sided,
                }
            )
        return out

    def caption(self, data: list[dict]) -> str:
        """What the colours mean and how far to trust them."""
        return (
            "Derivative of the base model's misfit by the stiffness of every element: blue where the recording wants "
            "the tissue stiffer, orange softer; left from above, right in the section through the centre (cross; the "
            "circle is its root mean square extent). A place that probe and markers can't feel stays white."
        )

    def draw(self, data: list[dict]) -> Figure:
        """Two panels a recording."""
        figure, axes = grid(2 * len(data), columns=2, width=9.0, height=3.0)
        for i, one in enumerate(data):
            for ax, cut, (a, b) in zip(axes[2 * i : 2 * i + 2], ("above", "section"), ((0, 1), (0, 2)), strict=True):
                outline, value = one[cut]
                ax.add_collection(
                    PolyCollection(outline, array=value, cmap=SIGNED, clim=(-1, 1), edgecolor="#d8dee4", linewidth=0.3)
                )
                ax.plot(*one["centre"][[a, b]], "+", color=INK)
                t = np.linspace(0, 2 * np.pi, 100)
                ax.plot(
                    one["centre"][a] + one["size"] * np.cos(t),
                    one["centre"][b] + one["size"] * np.sin(t),
                    color=INK,
                    linewidth=0.6,
                )
                ax.set_aspect("equal")
                ax.autoscale_view()
                ax.set_xlabel("x (mm)")
                ax.set_ylabel("yz"[b - 1] + " (mm)")
                ax.set_title(f"{one['recording']}, {cut}")
        return figure

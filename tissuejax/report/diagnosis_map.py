"""Where on the mesh the data want the tissue stiffer or softer: the base model's misfit, element by element."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.diagnosis.stiffness_map import StiffnessMap
from tissuejax.report.plot import INK, Plot, grid

MOST_MAPS = 3  # recordings shown, the strongest maps


@dataclass(frozen=True)
class Views:
    """One map as seen from above and from the side, mm: per column of elements the strongest density."""

    recording: str
    above: tuple[np.ndarray, np.ndarray, np.ndarray]
    side: tuple[np.ndarray, np.ndarray, np.ndarray]
    size: float
    one_sided: float
    sign: int
    centre: np.ndarray


def strongest(a: np.ndarray, b: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of all elements that lie behind each other at (a, b), the density of largest size."""
    step = 1e-3 * max(float(np.ptp(a)), float(np.ptp(b)), 1e-12)
    places = np.round(np.column_stack([a, b]) / step).astype(int)
    order = np.argsort(-np.abs(density), kind="stable")
    _, first = np.unique(places[order], axis=0, return_index=True)
    keep = order[first]
    keep = keep[np.argsort(np.abs(density[keep]))]  # the strongest are drawn last
    return 1e3 * a[keep], 1e3 * b[keep], density[keep]


class DiagnosisMap(Plot):
    """From above and from the side; red wants stiffer, blue softer."""

    name: ClassVar[str] = "stiffness-map"
    subject: ClassVar[type] = Diagnosis
    order: ClassVar[int] = 26

    def prepare(self, subject: Diagnosis) -> list[Views] | None:
        """Views of the strongest maps; None where no map was made."""
        maps = sorted(subject.maps, key=lambda m: -float(np.abs(m.gain).sum()))[:MOST_MAPS]
        return [self._views(m) for m in maps] or None

    @staticmethod
    def _views(m: StiffnessMap) -> Views:
        x, y, z = m.centres.T
        return Views(
            m.recording,
            strongest(x, y, m.density),
            strongest(x, z, m.density),
            float(np.abs(m.density).max()),
            m.one_sided,
            m.sign,
            1e3 * m.centre,
        )

    def caption(self, data: list[Views]) -> str:
        """What the strongest map says."""
        m = data[0]
        word = "stiffer" if m.sign > 0 else "softer"
        x, y, z = m.centre
        return (
            "How fast the misfit of the base model falls as each element becomes stiffer (red) or softer (blue), "
            f"per volume; of elements behind each other the strongest. {m.recording} wants the tissue {word} "
            f"in the main ({m.one_sided:.0%} of its map), about x {x:.1f}, y {y:.1f}, z {z:.1f} mm. A map locates; "
            "what it is, contrast and extent, comes from the refit, and a place that nothing can feel stays white. "
            "Depth is its weak coordinate."
        )

    def draw(self, data: list[Views]) -> Figure:
        """Two rows: from above, from the side."""
        n = len(data)
        figure, axes = grid(2 * n, columns=n, width=max(4.2 * n, 5.0), height=2.9)
        for i, m in enumerate(data):
            for ax, view, names in ((axes[i], m.above, "xy"), (axes[i + n], m.side, "xz")):
                a, b, density = view
                shown = dict(cmap="RdBu_r", vmin=-m.size, vmax=m.size, s=14, marker="s", linewidths=0)
                ax.scatter(a, b, c=density, **shown)
                ax.plot(m.centre[0], m.centre[1 if names == "xy" else 2], "+", color=INK, markersize=9)
                ax.set(aspect="equal", xlabel="x (mm)", ylabel=f"{names[1]} (mm)")
                ax.set_title(f"{m.recording}, {'from above' if names == 'xy' else 'from the side'}", loc="left")
        return figure

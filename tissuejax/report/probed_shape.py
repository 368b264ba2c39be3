"""The deformed body of a probing at its deepest moment, with measured and simulated markers."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from tissuejax.experiments.probing_predictor import ProbingPredictor
from tissuejax.experiments.probing_shape import Deformed, deformed
from tissuejax.fitting.result import Fit
from tissuejax.report.plot import INK, MEASURED, MODEL, PAPER, Plot, tidy

MOST_SITES = 3  # sites on one picture
MARGIN = 2e-3  # m of rest around the markers in plan


class ProbedShape(Plot):
    """Left the deformed mesh under the tip with the markers on it, right how far the markers moved, in plan."""

    name: ClassVar[str] = "shape"
    subject: ClassVar[type] = Fit
    order: ClassVar[int] = 15

    def prepare(self, subject: Fit) -> list[Deformed] | None:
        """The first sites at their deepest; None for a fit of other experiments."""
        predictor = subject.problem.predictor
        if not isinstance(predictor, ProbingPredictor):
            return None
        return [deformed(predictor, subject.values, name) for name in predictor.names[:MOST_SITES]]

    def caption(self, data: list[Deformed]) -> str:
        """How far the markers are apart."""
        said = []
        for site in data:
            gap = np.linalg.norm(site.simulated - site.measured, axis=1)
            if np.isfinite(gap).any():
                way = np.linalg.norm(site.measured - site.rest, axis=1)
                said.append(f"{site.name} {1e3 * np.nanmean(gap):.2f} mm of {1e3 * np.nanmax(way):.2f} mm moved")
        apart = f" Mean distance between measured and simulated markers, of the farthest way: {', '.join(said)}."
        return (
            "The simulated body when the probe is deepest, markers measured (dots) and simulated (crosses); right, "
            f"their motion from rest in plan, arrows enlarged.{apart if said else ''}"
        )

    def draw(self, data: list[Deformed]) -> Figure:
        """One row a site."""
        figure = Figure(figsize=(10, 3.6 * len(data)), layout="constrained", facecolor=PAPER)
        for row, site in enumerate(data):
            solid = figure.add_subplot(len(data), 2, 2 * row + 1, projection="3d", computed_zorder=False)
            _solid(solid, site)
            plan = figure.add_subplot(len(data), 2, 2 * row + 2)
            tidy(plan)
            _plan(plan, site)
        return figure


def _solid(ax, site: Deformed) -> None:
    x = 1e3 * site.points
    ax.add_collection3d(
        Poly3DCollection(x[site.facets], facecolor="#dfe7ec", edgecolor="#9fb0bc", linewidth=0.25, zorder=1)
    )
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    ball = 1e3 * (
        site.centre[:, None, None] + site.radius * np.stack([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)])
    )
    ax.plot_wireframe(*ball, color="#c0392b", linewidth=0.35, alpha=0.6, zorder=3, label="probe")
    style = {"depthshade": False}
    ax.scatter(*(1e3 * site.measured.T), color=INK, s=14, zorder=4, label="markers, measured", **style)
    ax.scatter(*(1e3 * site.simulated.T), color=MODEL, marker="x", s=26, zorder=5, label="markers, simulated", **style)
    tip = 1e3 * (site.centre + site.radius * np.array([[-1.0], [1.0]]))
    low, high = np.minimum(x.min(0), tip[0]), np.maximum(x.max(0), tip[1])
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(np.maximum(high - low, 1.0), zoom=0.95)  # the longest diagonal of any shape fits
    ax.legend(fontsize=7, frameon=False, loc="upper left")
    ax.view_init(elev=32, azim=-60)
    ax.set_axis_off()
    ax.set_title(f"{site.name}, t = {site.time:.2f} s", loc="left", fontsize=9.5, color=INK)


def _plan(ax, site: Deformed) -> None:
    seen = np.isfinite(site.measured).all(1) & np.isfinite(site.simulated).all(1) & np.isfinite(site.rest).all(1)
    rest, ways = 1e3 * site.rest[seen], [1e3 * (m[seen] - site.rest[seen]) for m in (site.measured, site.simulated)]
    ax.add_patch(_circle(site))
    if not seen.any():
        ax.set_title("no marker was seen in this frame", loc="left", fontsize=9, color=INK)
        return
    span = max(np.ptp(rest[:, :2], axis=0).max(), 1.0)
    enlarged = 0.2 * span / max(np.abs(ways[0]).max(), 1e-3)
    for way, colour, label in zip(ways, (MEASURED, MODEL), ("measured", "simulated"), strict=True):
        ax.quiver(
            *rest[:, :2].T,
            *(enlarged * way[:, :2]).T,
            angles="xy",
            scale_units="xy",
            scale=1,
            color=colour,
            width=0.006,
        )
        ax.quiver(
            *rest[:, :2].T, 0 * way[:, 2], enlarged * way[:, 2], angles="xy", scale_units="xy", scale=1, color=colour,
            width=0.003, alpha=0.5,
        )  # fmt: skip
        ax.plot([], [], color=colour, label=label)
    ax.plot(*rest[:, :2].T, ".", color=INK, markersize=3)
    ax.set_aspect("equal")
    ax.margins(0.25)
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("y (mm)")
    ax.set_title(f"motion x {enlarged:.0f}: thick in plan, thin vertical", loc="left", fontsize=9, color=INK)
    ax.legend(fontsize=7, frameon=False)


def _circle(site: Deformed):
    from matplotlib.patches import Circle

    return Circle(1e3 * site.centre[:2], 1e3 * site.radius, fill=False, color="#c0392b", linewidth=0.8)

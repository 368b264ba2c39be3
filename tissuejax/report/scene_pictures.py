"""A probing in three dimensions: deformed mesh, probe, markers and their residuals, as a picture and an animation.

Needs pyvista (the extra `pictures`); without it the states are still there for ParaView.
"""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.experiments.probing_points import markers_at, tip_at
from tissuejax.recordings.recording import Recording
from tissuejax.storage import replacing

MISSING = "pyvista is not installed: pip install 'tissuejax[pictures]', or open the .pvd or .xdmf file in ParaView"
VTK = {"hexahedron": 12, "tetra": 10}
MM = 1e3


@dataclass(frozen=True)
class Frame:
    """One moment, mm.

    Attributes:
        time: s.
        points: deformed nodes. moved: length of their displacement.
        probe: centre of the tip.
        predicted, measured: markers; measured is None where there is no measurement.
    """

    time: float
    points: Float[np.ndarray, "N 3"]
    moved: Float[np.ndarray, " N"]
    probe: Float[np.ndarray, "3"]
    predicted: Float[np.ndarray, "k 3"] | None
    measured: Float[np.ndarray, "k 3"] | None


@dataclass(frozen=True)
class Film:
    """All moments of one probing, with what does not move."""

    name: str
    cells: np.ndarray
    cell_type: str
    radius: float
    frames: tuple[Frame, ...]

    @property
    def deepest(self) -> Frame:
        """The moment of the largest displacement."""
        return max(self.frames, key=lambda f: float(f.moved.max()))


def film(states: Path, predicted: Recording, measured: Recording | None = None) -> Film:
    """The stored states with probe and markers at their times; markers are taken at the nearest sample."""
    with h5py.File(states) as file:
        points, cells, kind = file["points"][...], file["cells"][...], str(file.attrs["cell_type"])
        times = file["states/time"][...]
        moved = [file[f"states/displacement/{k}"][...] for k in range(len(times))]

    def markers(recording: Recording | None, t: float):
        found = markers_at(recording, t)
        return None if found is None else MM * found

    inside = [k for k, t in enumerate(times) if t <= predicted.inputs["probe/time"][-1] + 1e-9] or [0]
    frames = tuple(
        Frame(
            float(times[k]),
            MM * (points + moved[k]),
            MM * np.linalg.norm(moved[k], axis=1),
            MM * tip_at(predicted, times[k]),
            markers(predicted, times[k]),
            markers(measured, times[k]),
        )
        for k in inside
    )
    return Film(predicted.name, cells, kind, MM * float(predicted.attributes["probe/radius"]), frames)


def write_pictures(subject: Film, folder: Path, animate: bool = True) -> dict[str, Path]:
    """PNG of the deepest moment and GIF of all; paths by name.

    Raises:
        InputError: pyvista is missing.
    """
    try:
        import pyvista
    except ImportError as error:
        raise InputError(MISSING) from error
    pyvista.OFF_SCREEN = True
    pyvista.vtk_verbosity("off")  # without a display it warns of just that
    most = max(float(f.moved.max()) for f in subject.frames) or 1.0
    written = {}
    target = folder / f"{subject.name}.png"
    plotter = pyvista.Plotter(off_screen=True, window_size=(1100, 800))
    _draw(pyvista, plotter, subject, subject.deepest, most)
    with replacing(target) as temporary:
        plotter.screenshot(str(temporary))
    plotter.close()
    written["picture"] = target
    if animate and len(subject.frames) > 1:
        target = folder / f"{subject.name}.gif"
        plotter = pyvista.Plotter(off_screen=True, window_size=(760, 560))
        with replacing(target) as temporary:
            plotter.open_gif(str(temporary), fps=8)
            for frame in subject.frames:
                plotter.clear()
                _draw(pyvista, plotter, subject, frame, most)
                plotter.write_frame()
            plotter.close()
        written["animation"] = target
    return written


def words(colour: str) -> dict:
    """How text stands on a picture, placed by shares of the window."""
    return {"font_size": 10, "color": colour, "viewport": True}


def _draw(pyvista, plotter, subject: Film, frame: Frame, most: float) -> None:
    cells = np.hstack([np.full((len(subject.cells), 1), subject.cells.shape[1]), subject.cells]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(len(subject.cells), VTK[subject.cell_type]), frame.points)
    grid.point_data["displacement (mm)"] = frame.moved
    bar = {"title": "displacement\n(mm)\n", "color": "#22313f", "n_labels": 4, "fmt": "%.2f", "vertical": True}
    bar |= {"position_x": 0.88, "position_y": 0.08, "width": 0.07, "height": 0.5, "title_font_size": 14}
    bar["label_font_size"] = 14
    plotter.set_background("white")
    plotter.add_mesh(
        grid, scalars="displacement (mm)", clim=(0.0, most), cmap="viridis", show_edges=True, edge_color="#607080",
        line_width=0.5, scalar_bar_args=bar,
    )  # fmt: skip
    ball = pyvista.Sphere(radius=subject.radius, center=frame.probe, theta_resolution=40, phi_resolution=40)
    plotter.add_mesh(ball, color="#8795a1", opacity=0.45)
    size = 0.06 * subject.radius + 0.15
    legend = [("probe", "#8795a1")]
    if frame.predicted is not None:
        for place in frame.predicted[np.isfinite(frame.predicted).all(1)]:
            plotter.add_mesh(pyvista.Sphere(radius=size, center=place), color="#1f6fb2")
        legend.append(("markers, model", "#1f6fb2"))
    if frame.measured is not None:
        both = np.isfinite(frame.measured).all(1) & np.isfinite(frame.predicted).all(1)
        for here, there in zip(frame.measured[both], frame.predicted[both], strict=True):
            plotter.add_mesh(pyvista.Sphere(radius=size, center=here), color="#d9730d")
            plotter.add_mesh(pyvista.Line(here, there), color="#c0392b", line_width=3)
        legend += [("markers, measured", "#d9730d"), ("residual", "#c0392b")]
    plotter.add_text(f"{subject.name}, t = {frame.time:.2f} s", position=(0.02, 0.94), **words("#22313f"))
    for k, (label, colour) in enumerate(legend):
        plotter.add_text(label, position=(0.02, 0.89 - 0.045 * k), **words(colour))
    low, high = frame.points.min(0), frame.points.max(0)
    middle, span = 0.5 * (low + high), float(np.ptp(frame.points, axis=0).max())
    plotter.camera_position = [tuple(middle + span * np.array([1.5, -2.1, 1.3])), tuple(middle), (0, 0, 1)]

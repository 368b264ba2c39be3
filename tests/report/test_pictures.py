"""What a figure shows: a band wherever its legend promises one, an entry for every drawn style, nothing cut off."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from mpl_toolkits.mplot3d import proj3d

import tissuejax as tj
from tissuejax.commands.inspecting import described, text_of
from tissuejax.experiments.probing_shape import Deformed
from tissuejax.fitting.bands import marker_std
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.fit_overlay import FitOverlay, Shown
from tissuejax.report.overview import Overview
from tissuejax.report.plot import band, grid
from tissuejax.report.probed_shape import ProbedShape
from tissuejax.report.series import curves_of

DEMO = Path(tj.__file__).parents[1] / "data" / "demo" / "elastic.h5"


def shade(x):
    """Colour in the middle of a band of height one over `x`."""
    figure, (ax,) = grid(1)
    band(ax, x, np.zeros(len(x)), np.ones(len(x)), "#1f6fb2", "band")
    ax.grid(visible=False)
    ax.set(xlim=(0, 1), ylim=(0, 1))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())
    across, up = ax.transData.transform((0.5, 0.5))
    return tuple(pixels[len(pixels) - int(up), int(across)])


def test_a_band_that_turns_is_as_dark_as_one_that_does_not():
    once = shade([0.0, 0.4, 1.0])
    assert once != shade([0.0, 0.1])  # there is something in the middle
    assert shade([0.0, 1.0, 0.2, 0.9, 0.0]) == once
    assert shade([0.0, np.nan, 1.0]) != once  # no line is drawn over what is not known


def test_every_panel_of_a_cyclic_test_has_its_band_and_the_legend_names_all():
    found = tj.fit(DEMO, "neo-hookean", holdout=["holdout"], search=tj.Search(multistart=1))
    data = FitOverlay().prepare(found)
    assert not all(shown.curve.monotone for shown in data)
    figure = FitOverlay().draw(data)
    for ax in figure.axes:
        (patch,) = ax.patches
        assert patch.get_path().vertices[:, 1].max() <= ax.get_ylim()[1]
    bare = [Shown(d.curve, None if d.curve.held else d.band, None) for d in data]
    assert "No band was computed for holdout." in FitOverlay().caption(bare)
    assert "No band" not in FitOverlay().caption(data)
    named = {text.get_text() for text in figure.legends[0].get_texts()}
    assert named == {"measured", "95 % band", "model", "95 % band, held out", "model, held out"}


def test_a_probing_is_shown_over_depth():
    time, height = np.array([0.0, 1.0, 2.0]), np.array([0.030, 0.020, 0.030])
    inputs = {"probe/time": time, "probe/position": np.stack([0 * time, 0 * time, height], 1)}
    force = Channel(np.array([0.5, 1.0, 1.5]), np.ones((3, 3)), "N", 1e-3)
    press = Recording("press", "probing", inputs, {"force": force}, {})
    down = curves_of(press)[2]
    assert down.axis(by_time=False)[1] == "travel of the probe downwards (mm)"
    np.testing.assert_allclose(down.axis(by_time=False)[0], [5, 10, 5])
    deep = curves_of(press, touch=0.8)[2]  # met at a height of 22 mm
    assert deep.axis(by_time=False)[1] == "depth (mm)"
    np.testing.assert_allclose(deep.axis(by_time=False)[0], [-3, 2, -3], atol=1e-12)
    assert deep.axis(by_time=True)[1] == "time (s)"


def test_a_look_at_a_probing_names_its_axes_and_its_markers():
    time, z = np.arange(7.0), 1e-3 * np.array([24, 24, 24, 24, 24, 22, 20])
    inputs = {"probe/time": time, "probe/position": np.stack([2e-3 + 0 * z, 1e-3 * time, z], 1)}
    out = np.maximum(time - 4, 0)[:, None, None] * np.array([[1e-4, 0, 0], [0, 0, -3e-4], [0, 2e-4, 0]])
    press = Recording("press", "probing", inputs, {"markers": Channel(time, out + 0.01, "m", 1e-5)}, {})
    sample = Sample("s", {"press": press})
    said = "\n".join(text_of(described(sample)))
    assert "x 2 to 2, y 0 to 6, z 20 to 24 mm; 4 mm down" in said
    median, largest = Overview().prepare(sample)[0]
    assert median.channel.endswith("median")
    assert largest.channel.endswith("largest (marker 2)")
    np.testing.assert_allclose(median.measured[-2:], [2e-4, 4e-4])
    np.testing.assert_allclose(largest.measured[-2:], [3e-4, 6e-4])
    figure = Overview().draw(Overview().prepare(sample))
    shown = [ax.get_xlabel() for ax in figure.axes if ax.get_visible()]
    assert shown == ["travel of the probe downwards (mm)", "time (s)"] * 2


def test_the_band_of_the_markers_is_that_of_their_mean_way():
    # Two markers going out along x and along z, by 3 and 1 mm a unit of the parameter; the second is lost once.
    amount = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.0])
    slope = amount[:, None, None] * np.array([[3e-3, 0, 0], [0, 0, 1e-3]])
    seen = np.isfinite(np.where(np.arange(7)[:, None, None] == 5, [[0, 0, 0], [np.nan] * 3], slope)).ravel()
    sigma, std = 1e-4, 0.2
    problem = SimpleNamespace(
        rows={("press", "markers"): slice(0, seen.sum())},
        seen={("press", "markers"): np.flatnonzero(seen)},
        sigma=lambda key: sigma,
    )
    predicted = {"press": SimpleNamespace(channels={"markers": SimpleNamespace(values=slope)})}
    spread = SimpleNamespace(covariance=np.array([[std**2]]))
    told = marker_std(problem, slope.ravel()[seen, None] / sigma, spread, predicted)["press"]["markers"]
    np.testing.assert_allclose(told, std * np.array([0, 0, 0, 0, 0, 1.5e-3, 2e-3]), atol=1e-15)


@pytest.mark.parametrize("size", [(40.0, 40.0, 15.0), (10.0, 80.0, 60.0), (80.0, 20.0, 5.0)])
def test_the_body_of_a_probing_is_not_cut_off(size):
    corners = 1e-3 * np.array(size) * np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [0, 1]), -1).reshape(-1, 3)
    centre, none = np.array([0.0, 0.0, 1e-3 * size[2] + 6e-3]), np.zeros((0, 3))
    site = Deformed("s", 1.0, corners, np.array([[0, 1, 3, 2], [4, 5, 7, 6]]), centre, 8e-3, none, none, none)
    figure = ProbedShape().draw([site])
    figure.canvas.draw()
    solid = figure.axes[0]
    shown = 1e3 * np.concatenate([corners, centre + 8e-3 * np.concatenate([np.eye(3), -np.eye(3)])])
    x, y, _ = proj3d.proj_transform(*shown.T, solid.get_proj())
    places = solid.transData.transform(np.stack([x, y], 1))
    box = solid.get_window_extent()
    assert (places >= [box.x0, box.y0]).all()
    assert (places <= [box.x1, box.y1]).all()


def test_no_axis_asks_its_reader_to_add_an_offset():
    figure, (ax,) = grid(1)
    ax.plot([0.0, 1.0], [500.00001, 500.00002])
    figure.canvas.draw()
    assert ax.yaxis.get_offset_text().get_text() == ""

"""From a recording and the body to a scene ready for any parameter values: mesh, patch, clock, sensors. Host side.

Whatever a fit may change stays an array, and lengths are padded, so that recordings, sites and samples of like size
share one compiled program.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from tissuejax.arrays import Given
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.energies.volumetric import Quadratic
from tissuejax.errors import InputError
from tissuejax.experiments.probing_sensors import (
    Contact,
    contact_span,
    out_of_contact,
    rest_positions,
    smooth_path,
    surface_gap,
)
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.mesh.columns import Lobe, columns, lobe_of_mesh
from tissuejax.mesh.facets import Facets, boundary, facing_up
from tissuejax.mesh.markers import attach, nearest_nodes
from tissuejax.mesh.quality import cell_volumes, refuse_bad
from tissuejax.model import Model
from tissuejax.recordings.recording import Geometry, Recording, Sample
from tissuejax.tled.build import element, probe
from tissuejax.tled.scene import Body, Clock, Markers, Probe, Scene, Settings, Support, Tissue
from tissuejax.tled.shapes import Punch, Shape, Sphere

DENSITY = 1060.0  # kg/m^3, soft tissue: inertia is nothing in a probing, so a guess serves where none is recorded
# What differs between recordings is padded to multiples of these, so that they share one compiled program
FRAMES, SAMPLES, PATCH = 512, 2048, 64
FORCES, SHOWN, MARKERS = 1024, 256, 12
LATE = 0.5  # s simulated beyond the last sample: a clock that is off reads there, and later frames are zero


class Setup(eqx.Module):
    """One recording made ready.

    Attributes:
        scene: the scene with every effect absent and placeholder parameter values.
        test: what effects need to know.
        force_times, marker_times: sensor clocks, s, padded (marker_times is empty without markers).
        calm: weights (sum 1) of the frames out of contact, for the markers' rest.
        damping: mass damping over sqrt(shear modulus), 1/s per sqrt(Pa).
    """

    scene: Scene
    test: ProbingTest
    force_times: Float[Given, " n"]
    marker_times: Float[Given, " m"]
    calm: Float[Given, " frames"]
    damping: Float[Given, ""]


def setups(model: Model, sample: Sample, names: Sequence[str], settings: ProbingSettings) -> dict[str, Setup]:
    """Everything about the recordings that no parameter changes.

    Raises:
        InputError: no body, a bad mesh, no radius, clocks that don't overlap, a probe that starts inside the tissue or
            never touches, markers off the surface or NaN throughout, gravity without density.
    """
    if sample.geometry is None:
        raise InputError(
            f"sample {sample.name}: a probing needs the body under the tip: of a flat layer "
            "`tissuejax import TABLE --slab 20mm`, "
            "of another shape a side file with [body] (`tissuejax import --template probe`), in HDF5 /geometry"
        )
    if sample.density is None and any(effect.name == "gravity" for effect in model.effects):
        raise InputError(f"sample {sample.name}: gravity needs the density; add the attribute `density` (kg/m^3)")
    given = sample.geometry
    refuse_bad(given)
    top = facing_up(given.points, boundary(given.cells, given.cell_type))
    lobe = lobe_of_mesh(given) if settings.mesh == "graded" and given.cell_type == "hexahedron" else None
    touch, gaps = {}, {}
    every = {n: r for n, r in sample.recordings.items() if r.experiment == "probing"}
    for name, recording in every.items():
        _check_clocks(recording)
        time, path = smooth_path(recording, settings.smoothing)
        gaps[name] = surface_gap(path, tip_of(recording), given.points, top)
        touch[name] = contact_span(name, time, gaps[name], path[0])
    rest = _rest(every, touch)
    out = {}
    for name in names:
        if not np.isfinite(touch[name].first):
            raise InputError(
                f"recording {name}: the probe never touches the tissue (nearest {1e3 * gaps[name].min():.1f} mm); "
                "check the registration of probe and body, the radius and the units"
            )
        out[name] = _setup(model, sample, every[name], settings, lobe, touch[name], rest.get(name))
    return out


def retimed(setup: Setup, settings: ProbingSettings) -> Setup:
    """The same setup at another compression or another time step; masses follow the step, the penalty stays."""
    clock = setup.scene.clock
    steps = settings.changed(interval=float(clock.interval)).steps
    faster = Clock(
        clock.start,
        clock.interval,
        jnp.asarray(settings.compression, clock.interval.dtype),
        clock.frames,
        steps,
        clock.needed,
    )
    return eqx.tree_at(lambda s: s.scene.clock, setup, faster)


def _radius(recording: Recording) -> float:
    if "probe/radius" not in recording.attributes:
        raise InputError(f"recording {recording.name}: no probe/radius; give the radius of the tip in metres")
    return float(recording.attributes["probe/radius"])


def tip_of(recording: Recording) -> Shape:
    """A ball, or where the recording has a `probe/edge` a flat punch with an edge so rounded."""
    radius, edge = _radius(recording), recording.attributes.get("probe/edge")
    if edge is None:
        return Sphere(np.asarray(radius))
    if not 0 < float(edge) < radius:
        raise InputError(
            f"recording {recording.name}: probe/edge = {1e3 * float(edge):.3g} mm; the edge of a flat punch is rounded "
            f"by more than 0 and less than its radius, {1e3 * radius:.3g} mm"
        )
    return Punch(np.asarray(radius), np.asarray(float(edge)))


def _check_clocks(recording: Recording) -> None:
    """Sensor clocks must lie within the probe's, to a tenth of its length."""
    probe = np.asarray(recording.inputs["probe/time"], float)
    slack = 0.1 * np.ptp(probe)
    for channel in ("force", "markers"):
        if channel not in recording.channels:
            continue
        t = np.asarray(recording.channels[channel].time, float)
        if t[0] < probe[0] - slack or t[-1] > probe[-1] + slack:
            raise InputError(
                f"recording {recording.name}: {channel} runs from {t[0]:.3g} to {t[-1]:.3g} s but the probe from "
                f"{probe[0]:.3g} to {probe[-1]:.3g} s: the time bases don't overlap; bring them onto one clock"
            )


def _rest(every: dict[str, Recording], touch: dict[str, Contact]) -> dict[str, np.ndarray]:
    with_markers = {n: r.channels["markers"] for n, r in every.items() if "markers" in r.channels}
    if not with_markers:
        return {}
    calm = {n: out_of_contact(np.asarray(c.time), touch[n]) for n, c in with_markers.items()}
    noise = next(iter(with_markers.values())).noise_std
    return rest_positions({n: np.asarray(c.values, float) for n, c in with_markers.items()}, calm, noise)


def site(path: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "2"]:
    """Place in plan where the probe went deepest: the mean over the lowest quarter of its travel."""
    low = path[:, 2] < path[:, 2].min() + 0.25 * np.ptp(path[:, 2])
    return path[low, :2].mean(0)


def _setup(model, sample, recording, settings, lobe: Lobe | None, touch: Contact, rest) -> Setup:
    time, path = smooth_path(recording, settings.smoothing)
    radius = _radius(recording)
    deep = site(path)
    geometry = (
        sample.geometry if lobe is None else columns(lobe, settings.counts, [deep], settings.core, settings.ratio)
    )
    points, cells = np.asarray(geometry.points), np.asarray(geometry.cells)
    facets = boundary(cells, geometry.cell_type)
    upper = facing_up(points, facets)
    touching = path[(time >= touch.first - 0.2) & (time <= touch.last + 0.2)]
    near = reachable(points, upper, touching, radius + settings.margin)
    clock, frames_mid, frames_end = _clock(recording, time, settings)
    density = sample.density or DENSITY
    force_times = np.asarray(recording.channels["force"].time, float)
    marker_times, calm, on, shown = np.zeros(0), np.zeros(clock.frames), None, np.zeros((0, 3))
    if rest is not None:
        values = np.asarray(recording.channels["markers"].values, float)
        never = ~np.isfinite(values).all(2).any(0)  # not in this recording at all: a place and a NaN prediction will do
        where = np.where((np.isfinite(rest).all(1) | ~never)[:, None], rest, points[upper.nodes[0, 0]])
        placed = attach(where, points, upper)
        placed = nearest_nodes(where, points, upper) if settings.nearest_node else placed
        shown = _padded(rest, MARKERS)
        on = Markers(_padded(placed.nodes, MARKERS), _padded(placed.weights, MARKERS), shown)
        marker_times = np.asarray(recording.channels["markers"].time, float)
        calm = _calm(frames_end, marker_times, touch)
    nodes = cells.shape[1]
    volumes = cell_volumes(points, cells, geometry.cell_type)
    height = float(points[:, 2].max() if lobe is None else lobe.top.ev(*lobe.parameters_of(deep)))
    omega_over_root_mu = np.pi / 2 / height / np.sqrt(density)
    volumetric = model.volumetric if model.volumetric is not None else Quadratic()
    held = np.ones((len(geometry.fixed), 3))
    bare = Scene(
        Body(points, cells, np.asarray(geometry.fixed), held, facets.nodes, element(geometry.cell_type)),
        Tissue(model.energy, volumetric, _defaults(model.energy), _defaults(volumetric), np.asarray(density, float)),
        clock,
        Settings(np.asarray(settings.hourglass), np.asarray(0.0), np.asarray(settings.stiffness_damping)),
        Support(),
        None,
        on,
    )
    tip = probe(bare, tip_of(recording), *_padded_path(time, path), near, settings.penalty, settings.softness)
    scene = eqx.tree_at(lambda s: s.probe, bare, _widened(tip), is_leaf=lambda x: x is None)
    test = ProbingTest(
        start=np.asarray(float(recording.attributes.get("start", 0.0))),
        centres=points[cells].mean(1),
        mass=density * volumes / nodes,
        below_top=_below_top(geometry),
        height=np.asarray(height),
        first_touch=np.asarray(touch.first),
        rest=shown,
    )
    force_times, marker_times = _padded(force_times, FORCES), _padded(marker_times, SHOWN)
    setup = Setup(scene, test, force_times, marker_times, calm, np.asarray(settings.damping * omega_over_root_mu))
    dtype = jnp.float32 if settings.precision == "float32" else jnp.float64
    return eqx.tree_at(lambda s: s.scene, setup, scene.cast(dtype))


def _padded(series: np.ndarray, to: int) -> np.ndarray:
    """With its last entry repeated up to a multiple of `to`."""
    return np.concatenate([series, np.repeat(series[-1:], -len(series) % to, axis=0)])


def _defaults(part) -> dict[str, np.ndarray]:
    return {p.name: np.asarray(p.default, float) for p in part.parameters}


def reachable(
    points: Float[np.ndarray, "N 3"], upper: Facets, path: Float[np.ndarray, "n 3"], reach: float
) -> Int[np.ndarray, "P v"]:
    """Facets within `reach` in plan of the probe's path."""
    middle = points[upper.nodes].mean(1)
    along = path[:: max(1, len(path) // 200), :2]
    return upper.nodes[np.linalg.norm(middle[:, None, :2] - along[None], axis=2).min(1) < reach]


def _widened(probe: Probe) -> Probe:
    """With the patch padded to a multiple of 64 by facets of no area, so that sites share one program."""
    extra = -len(probe.patch) % PATCH
    patch = np.concatenate([probe.patch, np.repeat(probe.patch[-1:], extra, 0)])
    area = np.concatenate([probe.area, np.zeros((len(probe.area), extra))], 1)
    return eqx.tree_at(lambda p: (p.patch, p.area), probe, (patch, area))


def _clock(recording, probe_time, settings) -> tuple[Clock, np.ndarray, np.ndarray]:
    """Frames whose middles fall on the force samples where these are even and close to the wanted interval."""
    t = np.asarray(recording.channels["force"].time, float)
    spacing = float(np.median(np.diff(t)))
    even = np.ptp(np.diff(t)) < 1e-3 * spacing and 0.5 < spacing / settings.interval < 1.6
    interval = spacing if even else settings.interval
    begin = t[0] - 0.5 * interval
    last = max(t[-1], probe_time[-1] if "markers" in recording.channels else t[-1])
    needed = int(np.ceil((last + LATE - begin) / interval)) + 1
    frames = needed + -needed % FRAMES
    steps = settings.changed(interval=interval).steps
    speed = np.asarray(settings.compression)
    clock = Clock(np.asarray(begin), np.asarray(interval), speed, frames, steps, np.asarray(needed, np.int32))
    index = np.arange(frames)
    return clock, begin + interval * (index + 0.5), begin + interval * (index + 1.0)


def _calm(ends: np.ndarray, marker_times: np.ndarray, touch: Contact) -> np.ndarray:
    """Weights of simulation frames that stand for the marker frames out of contact."""
    times = marker_times[out_of_contact(marker_times, touch)]
    weights = np.zeros(len(ends))
    where = np.clip(np.searchsorted(ends, times), 1, len(ends) - 1)
    share = np.clip((times - ends[where - 1]) / (ends[where] - ends[where - 1]), 0, 1)
    np.add.at(weights, where, share)
    np.add.at(weights, where - 1, 1 - share)
    return weights / max(weights.sum(), 1)


def _padded_path(time: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    extra = -len(time) % SAMPLES
    later = time[-1] + np.arange(1, extra + 1) * (time[-1] - time[-2])
    return np.concatenate([time, later]), np.concatenate([path, np.repeat(path[-1:], extra, 0)])


def _below_top(geometry: Geometry) -> np.ndarray:
    """Depth of every node under the surface above it; interpolated between the upper nodes."""
    from scipy.interpolate import NearestNDInterpolator

    points = np.asarray(geometry.points)
    upper = np.unique(facing_up(points, boundary(geometry.cells, geometry.cell_type)).nodes)
    top = NearestNDInterpolator(points[upper, :2], points[upper, 2])(points[:, :2])
    return np.maximum(top - points[:, 2], 0.0)

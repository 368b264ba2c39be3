"""When the probe touches, where markers rest, and how the simulated series become what the sensors report."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import KDTree

from tissuejax.arrays import Given
from tissuejax.errors import InputError
from tissuejax.mesh.facets import Facets, triangles
from tissuejax.recordings.recording import Recording
from tissuejax.tled.shapes import Shape, Sphere

INSIDE = 1e-3  # m: a probe that starts deeper than this starts inside the tissue
FEWEST = 5  # frames out of contact that give a marker its rest position
CALM = 0.1  # s before first touch that still count as touched: the path is noisy
AFTER = 0.3  # s after last touch before the surface counts as free


def smooth_path(recording: Recording, width: float) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Probe path with its jitter smoothed by a Gaussian of `width` (s, full width): corners ring less."""
    time = np.asarray(recording.inputs["probe/time"], float)
    path = np.asarray(recording.inputs["probe/position"], float)
    spacing = float(np.median(np.diff(time)))
    if np.ptp(np.diff(time)) > 1e-3 * spacing:  # uneven clocks first onto an even one
        even = np.arange(time[0], time[-1] + spacing, spacing)
        path = np.stack([np.interp(even, time, path[:, i]) for i in range(3)], 1)
        time = even
    sigma = width / 2.355 / spacing
    return time, gaussian_filter1d(path, sigma, axis=0, mode="nearest") if sigma > 0.2 else path


def surface_gap(
    path: Float[np.ndarray, "n 3"], tip: Shape, points: Float[np.ndarray, "N 3"], facets: Facets
) -> Float[np.ndarray, " n"]:
    """Distance of the tip from the undeformed surface along its path, m; negative inside."""
    corners = np.asarray(points)[triangles(facets.nodes)]
    bary = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4
    dots = np.einsum("qc,fcd->fqd", bary, corners).reshape(-1, 3)
    if isinstance(tip, Sphere):
        return KDTree(dots).query(path)[0] - float(tip.radius)
    away = KDTree(path).query(dots)[0]
    dots = dots[away < max(3 * float(tip.reach()), float(away.min()) + float(tip.reach()))]

    def least(at):
        return jnp.min(tip.distance(tuple(dots.T - at[:, None]))[0])

    with jax.enable_x64(True):
        return np.asarray(jax.jit(lambda path: jax.lax.map(least, path))(np.asarray(path, float)))


class Contact(NamedTuple):
    """First and last touch of the undeformed surface, s, on the probe's clock; NaN if there is none."""

    first: float
    last: float


def contact_span(
    name: str, time: Float[np.ndarray, " n"], gap: Float[np.ndarray, " n"], centre: Float[np.ndarray, "3"]
) -> Contact:
    """When the path lies within the undeformed surface.

    Raises:
        InputError: the probe starts inside the tissue.
    """
    if gap[0] < -INSIDE:
        x, y, z = 1e3 * centre
        raise InputError(
            f"recording {name}: the probe starts {-1e3 * gap[0]:.1f} mm inside the tissue (centre at {x:.1f}, {y:.1f}, "
            f"{z:.1f} mm); it must start outside: check probe/radius, the registration and the units"
        )
    touched = np.flatnonzero(gap < 0)
    return Contact(float(time[touched[0]]), float(time[touched[-1]])) if len(touched) else Contact(np.nan, np.nan)


def out_of_contact(time: Float[np.ndarray, " m"], contact: Contact) -> Bool[np.ndarray, " m"]:
    """Marker frames that show the tissue at rest: before first touch, or after the last where those are too few."""
    if not np.isfinite(contact.first):
        return np.ones(len(time), bool)
    before = time < contact.first - CALM
    return before if before.sum() >= FEWEST else before | (time > contact.last + AFTER)


def rest_positions(
    markers: Mapping[str, Float[np.ndarray, "m k 3"]],
    calm: Mapping[str, Bool[np.ndarray, " m"]],
    noise: float | None,
) -> dict[str, Float[np.ndarray, "k 3"]]:
    """Rest position of each marker in each recording: the mean over frames out of contact.

    Pooled over recordings if the recordings agree to their noise, each recording's own if they don't (the support
    moves, or the tissue was laid anew).

    Raises:
        InputError: all markers NaN throughout a recording.
    """
    means, counts = {}, {}
    for name, x in markers.items():
        if not np.isfinite(x).any():
            raise InputError(f"recording {name}: every marker is NaN in every frame; leave the markers out of the file")
        some = x[calm[name]]
        counts[name] = np.isfinite(some).all(2).sum(0)
        total = np.where(np.isfinite(some), some, 0).sum(0)
        means[name] = np.where(counts[name][:, None] > 0, total / np.maximum(counts[name], 1)[:, None], np.nan)
    shapes = {m.shape for m in means.values()}
    if len(shapes) > 1 or len(means) == 1:
        return means
    weight = np.stack([counts[n] for n in means])[..., None]
    stack = np.stack([np.nan_to_num(means[n]) for n in means])
    pooled = (weight * stack).sum(0) / np.where(weight.sum(0) > 0, weight.sum(0), np.nan)
    if noise:
        misfit = weight * (stack - pooled) ** 2 / noise**2
        free = max(1, int((weight > 0).sum() - (weight.sum(0) > 0).sum()) * 3)
        if np.nansum(misfit) / free > 3.0:
            return {n: np.where(np.isfinite(means[n]), means[n], pooled) for n in means}
    return dict.fromkeys(means, pooled)


def read_at(
    times: Float[Given, " m"], clock: Float[Given, " n"], series: Float[Given, "n ..."]
) -> Float[Array, "m ..."]:
    """`series` given at `clock`, by linear interpolation at `times`, held at the ends."""
    flat = series.reshape(len(clock), -1)
    out = jax.vmap(lambda column: jnp.interp(times, clock, column), 1, 1)(flat)
    return out.reshape(len(times), *series.shape[1:])

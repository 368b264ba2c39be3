"""From the point cloud of an organ on a plate to a smooth height surface over its outline, ready for columns."""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RBFInterpolator

from tissuejax.errors import InputError
from tissuejax.mesh.columns import Lobe


def lobe_of_cloud(
    cloud: Float[np.ndarray, "S 3"],
    smoothing: float = 1e-3,
    rim: float = 1.5e-3,
    shrink: float = 0.97,
    harmonics: int = 8,
    size: int = 41,
) -> Lobe:
    """The lobe under a cloud of its free surface, standing on z = 0.

    The outline is a truncated Fourier series of the cloud's largest radius by direction (star-shaped about its
    middle); the height is a thin-plate spline with smoothing through at most 1500 of the points; the square grid
    reaches the outline by a smooth square-to-disc map.

    Args:
        cloud: points of the free surface, m, support at z = 0.
        smoothing: of the thin-plate spline, relative to its scale (0 interpolates).
        rim: least height at the rim, m: columns of no height can't be meshed.
        shrink: the plan is taken at this fraction of the outline, inside the ragged edge of the cloud.
        harmonics: of the outline.
        size: grid lines of the map.

    Raises:
        InputError: too few points, points that are not finite, a cloud below the support, or one that is not metres.
    """
    cloud = np.asarray(cloud, float)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or len(cloud) < 30 or not np.isfinite(cloud).all():
        raise InputError(f"point cloud of shape {cloud.shape}: expected at least 30 finite points (S, 3)")
    if np.ptp(cloud[:, :2], axis=0).max() > 2.0:
        raise InputError(f"the cloud is {np.ptp(cloud[:, 0]):.3g} m wide: lengths are metres, was it millimetres?")
    if np.median(cloud[:, 2]) <= 0:
        raise InputError("the cloud lies at or below z = 0, where the support is; shift it so that the plate is z = 0")
    centre = (cloud[:, :2].min(0) + cloud[:, :2].max(0)) / 2
    radius = _outline(cloud[:, :2] - centre, harmonics)
    height = _height(cloud, smoothing)
    u = np.linspace(-1, 1, size)
    a, b = np.meshgrid(u, u, indexing="ij")
    # elliptical square-to-disc map, softened (0.35 for 0.5) so that corner cells keep an angle below 180 degrees
    p, q = a * np.sqrt(1 - 0.35 * b**2), b * np.sqrt(1 - 0.35 * a**2)
    edge = np.maximum(np.abs(a), np.abs(b))
    angle = np.arctan2(q, p)
    reach = shrink * radius(angle) / np.where(edge > 0, np.hypot(p, q) / np.maximum(edge, 1e-12), 1)
    x, y = centre[0] + reach * p, centre[1] + reach * q
    z = np.maximum(height(np.stack([x.ravel(), y.ravel()], 1)).reshape(x.shape), rim)
    s = np.linspace(0, 1, size)
    return Lobe.of_grid(s, s, x, y, np.zeros_like(z), z)


def _outline(plan: Float[np.ndarray, "S 2"], harmonics: int):
    """Radius of the outline by direction."""
    angle, distance = np.arctan2(plan[:, 1], plan[:, 0]), np.hypot(*plan.T)
    bins = np.linspace(-np.pi, np.pi, 4 * harmonics + 1)
    which = np.digitize(angle, bins) - 1
    best = [
        np.flatnonzero(which == k)[distance[which == k].argmax()] for k in range(len(bins) - 1) if (which == k).any()
    ]
    if len(best) < 2 * harmonics + 1:
        raise InputError(
            f"the cloud covers {len(best)} of {len(bins) - 1} directions about its middle; it must surround it: "
            "add points or lower `harmonics`"
        )

    def terms(v):
        return np.stack([np.ones_like(v)] + [f(k * v) for k in range(1, harmonics + 1) for f in (np.cos, np.sin)], -1)

    ridge = np.diag([0.0] + [1e-3 * k**2 for k in range(1, harmonics + 1) for _ in "cs"])
    T = terms(angle[best])
    coefficients = np.linalg.solve(T.T @ T + ridge, T.T @ distance[best])
    return lambda v: terms(v) @ coefficients


def _height(cloud: Float[np.ndarray, "S 3"], smoothing: float):
    """Smooth height over plan."""
    step = max(1, len(cloud) // 1500)
    some = cloud[::step]
    scale = np.ptp(cloud[:, :2], axis=0).max()
    return lambda plan: RBFInterpolator(some[:, :2] / scale, some[:, 2], neighbors=None, smoothing=smoothing)(
        plan / scale
    )

"""The source's own way from a force record to strength and energy, by hand on plots there, here by rule (Lister 2012,
3.1).

Zero-phase Butterworth filter; segments (a slow load, then a drop) by the prominence of their peaks in x; a polynomial a
segment in x and z; the edge cut into sections of 0.2, 0.8 and 2.0 mm; forces on each section by its share of the
depth and width in contact (eq. 3.1, 3.2), along its normal and tangent (3.3, 3.4), over section length times thickness
(3.5, 3.6); the largest of a segment is its strength; the integral of both fits its energy.

What the numbers measure: section lengths cancel, so tau_n = (sin^2 th F_x/L_z + cos^2 th F_z/L_x) / b is at most the
larger of the two nominal pressures F_x/(L_z b), F_z/(L_x b), whatever law the tissue parts by; and the energy counts
wedging and friction with the parting. The strength of the law cannot be had from it.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.experiments.cutting_record import against_motion, path_of
from tissuejax.recordings.recording import Geometry, Recording

SECTIONS = (0.2e-3, 0.8e-3, 2.0e-3)


class Settings(NamedTuple):
    """cutoff of the filter, Hz (None: a twentieth of the sampling rate); its order; least prominence of a peak, in the
    largest force; degree of the polynomials."""

    cutoff: float | None = None
    order: int = 4
    prominence: float = 0.05
    degree: int = 3


class Tooth(NamedTuple):
    """One segment: samples from first to peak, critical forces N, depth and width in contact m, energy J and J/m^2,
    strengths (normal, tangential) Pa by section length, and where the edge stood at the peak, m."""

    first: int
    peak: int
    critical: tuple[float, float]
    contact: tuple[float, float]
    energy: float
    per_area: float
    strength: dict[float, tuple[float, float]]
    at: float


class Sawtooth(NamedTuple):
    """All segments; the filtered force (x against the motion, z), the clock, and the settings used."""

    teeth: tuple[Tooth, ...]
    time: Float[np.ndarray, " f"]
    force: Float[np.ndarray, "f 2"]
    fits: tuple[tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]], ...]
    cutoff: float
    settings: Settings


def sections(profile: Float[np.ndarray, "p 2"], depth: float, length: float) -> Float[np.ndarray, "s 3"]:
    """The edge in contact (up to `depth` above the tip) in sections of about `length`: height, width (m), angle (rad).

    The angle th is that of the section's normal from the vertical: 90 degrees on a vertical edge.
    """
    x, z = (np.asarray(profile, float) - profile[0]).T
    fine = np.linspace(0, min(depth, z[-1]), 2001)
    edge = np.interp(fine, z, x)
    arc = np.concatenate([[0], np.cumsum(np.hypot(np.diff(edge), np.diff(fine)))])
    cuts = np.append(np.arange(0, arc[-1] - 1e-9, length), arc[-1])
    dz, dx = np.diff(np.interp(cuts, arc, fine)), np.abs(np.diff(np.interp(cuts, arc, edge)))
    return np.stack([dz, dx, np.arctan2(dz, dx)], 1)


def strengths(F: tuple[float, float], contact: tuple[float, float], b: float, edge: Float[np.ndarray, "s 3"]):
    """Largest normal and tangential stress of the sections, Pa (eq. 3.1 to 3.6)."""
    depth, width = contact
    Fc = edge[:, 0] * F[0] / depth
    Fv = edge[:, 1] * F[1] / width if width > 1e-9 else 0.0 * edge[:, 1]
    th, size = edge[:, 2], np.hypot(edge[:, 0], edge[:, 1]) * b
    normal = (Fc * np.sin(th) + Fv * np.cos(th)) / size
    along = (Fc * np.cos(th) - Fv * np.sin(th)) / size
    return float(normal.max()), float(np.abs(along).max())


def sawtooth(recording: Recording, geometry: Geometry, settings: Settings | None = None) -> Sawtooth:
    """Segments of a cutting record.

    Raises:
        InputError: too few samples, a cut-off beyond half the sampling rate, no tooth in the record.
    """
    from scipy.signal import butter, find_peaks, sosfiltfilt  # half a second to load, and every page loads this room

    settings = settings or Settings()
    path = path_of(recording, geometry)
    channel = recording.channels["force"]
    time, value = np.asarray(channel.time, float), np.asarray(channel.values, float)
    rate = 1 / float(np.median(np.diff(time)))
    cutoff = rate / 20 if settings.cutoff is None else settings.cutoff
    if not 0 < cutoff < rate / 2:
        raise InputError(
            f"--cutoff {cutoff:.4g} Hz: it must lie between 0 and half the sampling rate ({rate / 2:.4g} Hz)"
        )
    sos = butter(settings.order, cutoff / (rate / 2), output="sos")
    if len(time) <= 3 * (2 * len(sos) + 1):
        raise InputError(f"recording {recording.name}: {len(time)} samples are too few for a filter of this order")
    force = np.stack([sosfiltfilt(sos, against_motion(recording)), sosfiltfilt(sos, np.abs(value[:, 2]))], 1)
    x = np.interp(time, path.time, path.x)
    fresh = np.interp(time, path.time, path.fresh) > 0.5
    peaks, _ = find_peaks(np.where(fresh, force[:, 0], 0.0), prominence=settings.prominence * force[:, 0].max())
    profile = np.asarray(recording.attributes["blade/profile"], float)
    teeth, fits, last = [], [], int(np.argmax(x > 0))
    for peak in peaks:
        first = last + int(np.argmin(force[last : peak + 1, 0]))
        last = peak
        depth = float(np.interp(time[peak], path.time, path.depth))
        if peak - first < settings.degree + 2 or depth <= 0:
            continue
        s = np.linspace(-1, 1, peak - first + 1)
        curves = [np.polyval(np.polyfit(s, force[first : peak + 1, i], settings.degree), s) for i in (0, 1)]
        critical = float(curves[0][-1]), float(curves[1][-1])
        whole = sections(profile, depth, 1.0)
        contact = depth, float(whole[:, 1].sum())
        energy = float(sum(np.trapezoid(c, x[first : peak + 1]) for c in curves))
        found = {
            length: strengths(critical, contact, path.thickness, sections(profile, depth, length))
            for length in SECTIONS
        }
        area = max(x[peak] - x[first], 1e-9) * depth
        teeth.append(Tooth(first, int(peak), critical, contact, energy, energy / area, found, float(x[peak])))
        fits.append(tuple(curves))
    if not teeth:
        raise InputError(
            f"recording {recording.name}: no tooth (a rise and a drop of {settings.prominence:.0%} of the greatest "
            "force) "
            "in the part that cuts fresh tissue; lower --prominence, or fit the whole record with `tissuejax cut fit`"
        )
    return Sawtooth(tuple(teeth), time, force, tuple(fits), cutoff, settings)


def mesh_period(found: Sawtooth, h: float) -> str | None:
    """A warning if teeth come at the period of a mesh of element size h, or half of it; None if not."""
    if len(found.teeth) < 4:
        return None
    gaps = np.diff([t.at for t in found.teeth])
    middle = float(np.median(gaps))
    near = min(abs(middle / h - 1), abs(2 * middle / h - 1))
    if near > 0.15 or np.std(gaps) > 0.25 * middle:
        return None
    return (
        f"the teeth are {1e3 * middle:.2f} mm apart, evenly: the period of elements of {1e3 * h:.2f} mm. A simulated "
        "record shows its mesh so; tissue does not"
    )

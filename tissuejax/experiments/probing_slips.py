"""Plausibility of probings: what looks like a slip of unit, sign or registration, before anything is simulated."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.experiments.probing_sensors import INSIDE, surface_gap
from tissuejax.experiments.probing_setup import tip_of
from tissuejax.mesh.facets import Facets, boundary, facing_up
from tissuejax.recordings.plausible import slips
from tissuejax.recordings.recording import Recording, Sample
from tissuejax.tled.shapes import Sphere

PRESSURES = (1.0, 5e5)  # Pa over the cross section of the ball: below nothing is felt, above soft tissue is torn
LARGEST = 3.0  # m: no rig is as large
ALREADY = 0.1  # of the tip's radius below the surface at the first sample
LOADED = 0.5  # of the largest force, at the first sample: nothing was zeroed, or the start is missing


def probing_slips(sample: Sample, names: Iterable[str] | None = None) -> list[str]:
    """Sentences on what looks like a slip, recording by recording; none for other experiments.

    Args:
        sample: the sample.
        names: recordings to look at; all by default.
    """
    chosen = sample.recordings if names is None else names
    probed = [n for n in chosen if sample.recordings[n].experiment == "probing"]
    if not probed or sample.geometry is None:
        return []
    points = np.asarray(sample.geometry.points, float)
    said = _body(points)
    try:
        top = facing_up(points, boundary(sample.geometry.cells, sample.geometry.cell_type))
    except InputError:
        return said  # a fit says what is wrong with the body
    for name in probed:
        said += [f"{name}: {sentence}" for sentence in _probing(sample.recordings[name], points, top)]
    return said


def all_slips(sample: Sample, names: Iterable[str] | None = None) -> list[str]:
    """What looks like a slip in recordings of any experiment, sentence by sentence."""
    names = tuple(sample.recordings if names is None else names)
    return [*slips(sample, names), *probing_slips(sample, names)]


def warned(slips_said: Iterable[str]) -> list[str]:
    """Slips as warnings of a fit."""
    return [f"Look at the data: {said}" + ("" if said.endswith("?") else ".") for said in slips_said]


def _body(points: Float[np.ndarray, "N 3"]) -> list[str]:
    size = float(np.ptp(points, axis=0).max())
    if size > LARGEST:
        return [f"the body is {size:.4g} m large: mm read as m?"]
    return []


def _probing(recording: Recording, points: Float[np.ndarray, "N 3"], top: Facets) -> list[str]:
    path = np.asarray(recording.inputs["probe/position"], float)
    reach = float(np.ptp(path, axis=0).max())
    if reach > LARGEST:
        return [f"the probe moves over {reach:.4g} m: mm read as m?"]
    try:
        tip = tip_of(recording)
    except InputError:
        return []  # a fit says what is wrong with the tip
    few = path[:: max(1, len(path) // 400)]
    gap = surface_gap(few, tip, points, top)
    said = []
    if gap[0] < -min(INSIDE, ALREADY * float(tip.reach())):
        said.append(
            f"the probe starts {-1e3 * gap[0]:.1f} mm inside the tissue; it must start outside: check the radius, the "
            "registration of probe and body and the units"
        )
    if gap.min() > 0:
        said.append(
            f"the probe never touches the tissue (nearest {1e3 * gap.min():.1f} mm): check the registration of probe "
            "and body, the radius and the units"
        )
    said += _forces(recording, path, few, gap, tip)
    return said


def _forces(recording: Recording, path, few, gap: Float[np.ndarray, " n"], tip) -> list[str]:
    channel = recording.channels.get("force")
    if channel is None:
        return []
    force, said = np.asarray(channel.values, float).reshape(len(channel.values), -1), []
    size = np.linalg.norm(force, axis=1)
    seen = np.isfinite(size)
    if not seen.any() or not np.ptp(size[seen]):
        return said
    most = float(size[seen].max())
    if isinstance(tip, Sphere):
        pressure = most / (np.pi * float(tip.radius) ** 2)
        if pressure > PRESSURES[1]:
            said.append(
                f"the force reaches {most:.4g} N, {pressure:.3g} Pa over the cross section of the ball, which soft "
                "tissue does not bear: mN or N read as kN, or the radius in another unit?"
            )
        elif pressure < PRESSURES[0]:
            said.append(
                f"the force stays below {most:.3g} N, {pressure:.2g} Pa over the cross section of the ball: N read as "
                "mN, or the radius in another unit?"
            )
    inward = path[int(np.argmin(np.linalg.norm(path - few[int(np.argmin(gap))], axis=1)))] - path[0]
    if gap.min() < 0 and force.shape[1] == 3 and np.linalg.norm(inward) > 0:
        at = force[int(np.argmax(np.where(seen, size, -1.0)))]
        if at @ inward > 0.3 * np.linalg.norm(at) * np.linalg.norm(inward):
            said.append(
                "the force points into the tissue where the probe is pressed: it must be that of the tissue on the "
                "probe; turn the sign round"
            )
    first = float(np.median(size[seen][:3]))
    if gap[0] > 0 and first > LOADED * most:
        said.append(
            f"the force starts at {first / most:.0%} of its largest while the probe is {1e3 * gap[0]:.1f} mm away: an "
            "offset of the sensor"
        )
    return said

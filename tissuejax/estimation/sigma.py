"""Noise levels of a sample's recordings: as recorded, or as far as the recordings themselves tell."""

import numpy as np

from tissuejax.estimation.level import Level, Response, levels
from tissuejax.recordings.recording import Sample

QUIETEST = 1e-3  # of the root mean square of a series: below this nothing is believed of a noise that was not recorded


def sigmas(
    sample: Sample, names: tuple[str, ...], channel: str = "nominal_stress"
) -> tuple[dict[str, float], list[str]]:
    """Noise standard deviation of each recording, and remarks where it had to be estimated and how sure that is."""
    out, unknown = {}, {}
    for name in names:
        c = sample.recordings[name].channels[channel]
        if c.noise_std:
            out[name] = float(c.noise_std)
        else:
            unknown[name] = c
    if not unknown:
        return out, []
    responses, owners = [], []
    for name, c in unknown.items():
        inputs = sample.recordings[name].inputs
        drive = np.asarray(inputs["shear" if "shear" in inputs else "stretch"], float).reshape(len(c.time), -1)
        values = np.asarray(c.values, float).reshape(len(c.time), -1)
        for i in range(values.shape[1]):
            with_all, kept = drive[:, min(i, drive.shape[1] - 1)], np.isfinite(values[:, i])
            responses.append(Response(np.asarray(c.time, float)[kept], with_all[kept], values[kept, i]))
            owners.append(name)
    found = levels(responses)
    sizes = {name: float(np.sqrt(np.nanmean(np.asarray(c.values, float) ** 2))) or 1.0 for name, c in unknown.items()}
    parts = {name: [x for x, owner in zip(found, owners) if owner == name] for name in unknown}
    for name, own in parts.items():
        out[name] = max(float(np.sqrt(np.mean([x.std**2 for x in own]))), QUIETEST * sizes[name])
    unit = next(iter(unknown.values())).unit
    said = ", ".join(f"{name} {out[name]:.3g} {unit}" for name in unknown)
    remarks = [f"noise was not recorded and is estimated from the recordings themselves: {said}"]
    return {name: out[name] for name in names}, remarks + caution(parts, unit)


def caution(parts: dict[str, list[Level]], unit: str) -> list[str]:
    """What an estimated noise level can't be trusted for."""
    out = []
    if short := [name for name, own in parts.items() if any(x.short for x in own)]:
        out.append(
            f"{', '.join(short)}: too few samples to tell slow noise from the response; noise is taken as white, and "
            "if it was filtered or correlated it is larger than said, and misfit is overstated: record a rest, or "
            "give noise_std"
        )
    if coarse := {name: max(x.resolution for x in own) for name, own in parts.items()}:
        steps = [f"{name} {step:.3g} {unit}" for name, step in coarse.items() if step > 0]
        if steps:
            out.append(f"values were recorded in steps ({', '.join(steps)}); noise is at least step / sqrt(12)")
    if unsure := {name: max(x.left for x in own) for name, own in parts.items() if not all(x.certain for x in own)}:
        said = ", ".join(f"{name} {left:.3g} {unit}" for name, left in unsure.items())
        out.append(
            f"beside that noise there is a smooth part that no general response to the drive explains ({said}): noise "
            "behind a filter would look like it, so its level can't be known from these recordings and a verdict that "
            "something is missing rests on its not being noise; record a rest, or give noise_std"
        )
    return out

"""What is unusual about a sample's recordings, in sentences: worth knowing before a fit, no reason to refuse."""

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings import checks
from tissuejax.recordings.plausible import slips
from tissuejax.recordings.recording import Sample

DENSITY = (300.0, 3000.0)  # kg/m^3: lung to bone


def remarks(sample: Sample) -> list[str]:
    """Sentences on what is unusual and worth knowing before a fit; none where all is plain."""
    said = _weight(sample)
    try:
        checks.distinct(sample.recordings.items())
    except InputError as error:
        said.append(str(error))
    for name, recording in sample.recordings.items():
        for key, channel in recording.channels.items():
            values = np.asarray(channel.values)
            lost = np.isnan(values).reshape(len(values), -1).any(axis=1).mean()
            if lost > 0:
                share = float(np.isnan(values).mean())
                said.append(f"{name}: {share:.1%} of {key} is missing (NaN), in {lost:.0%} of the samples.")
            if not channel.noise_std:
                said.append(f"{name}: no noise level for {key}: a fit has to estimate it.")
    return said + slips(sample)


def _weight(sample: Sample) -> list[str]:
    """What of density and gravity looks like a slip of unit or sign."""
    said = []
    if sample.density is not None and not DENSITY[0] <= sample.density <= DENSITY[1]:
        slip = "g/cm^3 read as kg/m^3?" if DENSITY[0] <= 1e3 * sample.density <= DENSITY[1] else "check its unit."
        said.append(f"density is {sample.density:.4g} kg/m^3, where soft tissue has about 1000: {slip}")
    if sample.gravity is not None and sample.gravity[2] > 0:
        x, y, z = sample.gravity
        said.append(
            f"gravity [{x:g}, {y:g}, {z:g}] m/s^2 points upward: the body stands on z = 0 and hangs from it so; if it "
            f"rests on it, the sign is turned round: [{x:g}, {y:g}, {-z:g}]."
        )
    return said

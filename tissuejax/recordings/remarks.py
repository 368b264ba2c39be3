"""What is unusual about a sample's recordings, in sentences: worth knowing before a fit, no reason to refuse."""

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings import checks
from tissuejax.recordings.plausible import slips
from tissuejax.recordings.recording import Sample


def remarks(sample: Sample) -> list[str]:
    """Sentences on what is unusual and worth knowing before a fit; none where all is plain."""
    said = []
    try:
        checks.distinct(sample.recordings)
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
        stretch = recording.inputs.get("stretch")
        if stretch is not None and abs(float(np.asarray(stretch)[0].max()) - 1.0) > 0.02:
            said.append(f"{name}: starts at stretch {np.asarray(stretch)[0]}, not at rest (1).")
    return said + slips(sample)

"""Cohorts of specimens whose stiffness is known, as files, for tests of campaigns."""

import numpy as np

from tests.specimens import recording
from tissuejax.campaign.task import Settings
from tissuejax.recordings.hdf5_writing import write
from tissuejax.recordings.recording import Channel, Recording, Sample

STRETCH = np.linspace(1.0, 1.3, 20)
SETTINGS = Settings("fit", "neo-hookean", multistart=1)


def cohort(folder, n=5, bad=True):
    """Files of n specimens of known stiffness, and one that no neo-Hookean fit can take."""
    rng, files = np.random.default_rng(3), []
    time_ = np.arange(20.0)
    for k in range(n):
        made = recording("pull", "uniaxial", time_, STRETCH)
        stress = (1000 + 100 * k) * (STRETCH - STRETCH**-2) + 5 * rng.normal(size=20)
        channel = Channel(time_, stress, "Pa", 5.0)
        file = folder / f"s{k}.h5"
        write(
            Sample(f"s{k}", {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})}), file
        )
        files.append(str(file))
    if bad:
        twin = Recording("again", "uniaxial", made.inputs, {"nominal_stress": channel}, {})
        first = Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})
        write(Sample("twins", {"pull": first, "again": twin}), folder / "twins.h5")
        files.append(str(folder / "twins.h5"))
    return files


def pull(name, stress):
    """A specimen's pull, its noise said to be 5 Pa."""
    made = recording("pull", "uniaxial", np.arange(20.0), STRETCH)
    channel = Channel(np.arange(20.0), stress, "Pa", 5.0)
    return Sample(name, {"pull": Recording("pull", "uniaxial", made.inputs, {"nominal_stress": channel}, {})})

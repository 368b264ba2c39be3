"""What a fit and a diagnosis say of the misfit of one file is one number, whether its noise was recorded or not."""

from dataclasses import replace
from pathlib import Path

import pytest

import tissuejax as tj

DEMO = Path(__file__).parents[2] / "data" / "demo" / "relaxing.h5"


@pytest.mark.parametrize("recorded", [True, False])
def test_chi_square_per_sample_is_that_of_the_diagnosis(recorded):
    sample = tj.read(DEMO)
    if not recorded:
        blank = {
            n: replace(r, channels={k: replace(c, noise_std=None) for k, c in r.channels.items()})
            for n, r in sample.recordings.items()
        }
        sample = replace(sample, recordings=blank)
    fit = tj.fit(sample, "reduced-polynomial-2")
    before = tj.diagnose(sample, "reduced-polynomial-2", holdout=(), effects=("slack",)).as_dict()["before"]
    for key, score in fit.channels.items():
        recording, channel = key.split("/")
        said = before[recording][channel]["chi2_per_sample"]
        # where none was recorded a fit weighs recordings alike, and a diagnosis by their own noise: parameters differ
        assert score.chi2_per_sample == pytest.approx(said, rel=1e-6 if recorded else 5e-3)
        assert score.chi2_per_sample > 100  # it relaxes, and the law does not

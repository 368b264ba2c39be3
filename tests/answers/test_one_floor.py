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
    ours = theirs = 0.0
    for key, score in fit.channels.items():
        recording, channel = key.split("/")
        said = before[recording][channel]
        assert score.rmse**2 / score.chi2_per_sample == pytest.approx(
            said["rmse"] ** 2 / said["chi2_per_sample"], rel=1e-9
        )
        assert score.n == said["n"]
        if recorded:
            assert score.chi2_per_sample == pytest.approx(said["chi2_per_sample"], rel=1e-6)
        assert score.chi2_per_sample > 100  # it relaxes, and the law does not
        ours, theirs = ours + score.n * score.chi2_per_sample, theirs + said["n"] * said["chi2_per_sample"]
    # where none was recorded a fit weighs recordings alike, and a diagnosis by their own noise: the same chi-squares of
    # parameters that differ, of which the diagnosis' have the least sum
    assert 1 - 1e-9 < ours / theirs < 1.001

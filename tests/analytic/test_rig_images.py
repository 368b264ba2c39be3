"""Widths from drawn pictures of a bulging cylinder between platens, whose width is known to a hundredth of a pixel."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tissuejax.errors import InputError
from tissuejax.recordings import files, images, rig
from tissuejax.recordings.recording import Channel, Recording, Sample

ROWS, COLUMNS, TOP = 240, 320, 40.5


def drawn(width: float, gap: float, bulge: float = 8.0, middle: float = 160.3, blur: float = 0.8, noise=0.0, seed=0):
    """A dark barrel of `width` pixels at mid-height, `bulge` more than at its ends, between two dark platens.

    Each pixel has the share of it that is covered, so that edges lie between pixels.
    """
    y, x = np.arange(ROWS)[:, None], np.arange(COLUMNS)[None, :]
    place = (y - (TOP + gap / 2)) / (gap / 2)
    half = 0.5 * (width - bulge * place**2)
    specimen = np.clip(half + 0.5 - np.abs(x - middle), 0, 1)
    platen = np.clip(TOP + 0.5 - y, 0, 1) + np.clip(y - (TOP + gap) + 0.5, 0, 1)
    paper = np.array([0.92, 0.9, 0.85])
    ink = np.where(platen[..., None] > 0, np.array([0.2, 0.2, 0.22]), np.array([0.45, 0.15, 0.12]))
    cover = np.clip(specimen + platen, 0, 1)[..., None]
    picture = gaussian_filter(paper * (1 - cover) + ink * cover, (blur, blur, 0))
    return picture + noise * np.random.default_rng(seed).standard_normal(picture.shape)


@pytest.mark.parametrize("blur", [0.5, 1.5])
@pytest.mark.parametrize("width", [90.0, 101.37, 130.81])
@pytest.mark.parametrize("gap", [150.0, 97.4])
def test_width_and_gap_to_a_quarter_of_a_pixel(width, gap, blur):
    seen = images.silhouette(drawn(width, gap, blur=blur, noise=0.01))
    assert seen.width == pytest.approx(width, abs=0.25)
    assert seen.gap == pytest.approx(gap, abs=0.3)
    assert 0.5 * (seen.left + seen.right) == pytest.approx(160.3, abs=0.2)


def test_grey_pictures_other_ranges_and_given_platens():
    picture = drawn(100.0, 140.0)
    grey = picture.mean(axis=2)
    expected = images.silhouette(picture).width
    assert images.silhouette(grey).width == pytest.approx(expected, abs=0.1)
    assert images.silhouette((255 * grey).astype(np.uint8)).width == pytest.approx(expected, abs=0.1)
    assert images.silhouette(1 - grey).width == pytest.approx(expected, abs=0.1)
    assert images.silhouette(grey, platens=(TOP, TOP + 140)).width == pytest.approx(100, abs=0.25)


def test_compression_from_a_sequence_of_pictures():
    true = np.linspace(1.0, 0.6, 9)
    pictures = [drawn(100 / np.sqrt(l), 150 * l, 12 * (1 - l), noise=0.01, seed=k) for k, l in enumerate(true)]
    # l1 = 1/l2^2: a quarter of a pixel in 100 is half a per cent.
    np.testing.assert_allclose(images.stretches(pictures), true, rtol=5e-3)
    first = images.silhouette(pictures[0])
    assert images.metres_per_pixel(first, 0.03) * 150 == pytest.approx(0.03, rel=2e-3)


def test_a_rig_run_becomes_a_recording(tmp_path, rng):
    """Pictures, force and contact voltage of one compression, in the source's order of steps, to a file and back."""
    area, height = rig.thawed_area(0.0127, 0.020, 0.018), 0.018
    time = np.arange(0, 12, 1 / 62.5)
    true = np.clip(1 - 0.05 * (time - 2), 0.6, 1)
    stress = 800 * (true - true**-2)
    force = stress * area + 0.002 * rng.standard_normal(len(time))
    voltage = np.where(time < 2, 0.1, 4.9) + 0.05 * rng.standard_normal(len(time))
    start = rig.contact_time(time, voltage)
    assert start == pytest.approx(2.0, abs=0.02)
    frames = np.arange(start, 10, 0.5)
    shown = np.interp(frames, time, true)
    pictures = [drawn(100 / np.sqrt(l), 150 * l, 0.0, noise=0.01, seed=k) for k, l in enumerate(shown)]
    stretch = rig.polynomial(frames - start, images.stretches(pictures), 1, through=(0.0, 1.0))(frames - start)
    nominal = np.interp(frames, time, rig.lowpass(time, force, 4.0)) / area
    inputs = {"time": frames - start, "stretch": stretch}
    channel = Channel(frames - start, nominal, "Pa", 0.002 / area)
    recording = Recording("run 1", "uniaxial", inputs, {"nominal_stress": channel}, {"area": area, "height": height})
    files.write(Sample("liver", {"run 1": recording}), tmp_path / "liver.h5")
    back = files.read(tmp_path / "liver.h5").recordings["run 1"]
    np.testing.assert_allclose(back.inputs["stretch"], shown, atol=3e-3)
    np.testing.assert_allclose(back.channels["nominal_stress"].values, 800 * (shown - shown**-2), atol=15)


def test_pictures_that_show_no_specimen():
    with pytest.raises(InputError, match="without contrast"):
        images.silhouette(np.ones((50, 50)))
    with pytest.raises(InputError, match="no two level platens"):
        images.silhouette(np.random.default_rng(0).uniform(size=(60, 60)))
    with pytest.raises(InputError, match="outline points"):
        images.silhouette(drawn(-50.0, 140.0, bulge=0.0))
    with pytest.raises(InputError, match="above zero"):
        images.metres_per_pixel(images.Silhouette(0, 10, 0, 10), 0.0)

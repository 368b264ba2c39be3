"""Breathing as in the source's first experiment (fig. 2.26): markers go up and down by 4 mm before the probe comes.

Site 3 of fits/in-vivo-liver on a support that is lifted by 2 mm to either side: two breaths out of contact, the press,
two breaths held. The motion is read off the markers out of contact; then one factor on the moduli is fitted to the
force, with that motion in the model and without.
"""

import numpy as np
from scipy.optimize import curve_fit

from tissuejax.effects.support_motion import SupportMotion
from tissuejax.energies.catalogue import volumetric
from tissuejax.energies.published import published
from tissuejax.experiments.predictor import predictor
from tissuejax.mesh.columns import columns
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample

SITE, LAW, NAME = "site 3", "in-vivo-3", "breath"
NEAREST = 0  # a marker 7 mm from the axis
RANGE, FREQUENCY, PHASE = 4e-3, 0.25, 0.7  # m, 1/s (the source prints no rate), rad
GAP, CALM = 3.5e-3, 8.0  # m above the tissue at rest, more than it is lifted; s out of contact, and held
TURNS = 3  # of the factor; the force is nearly linear in it
OFF = 1.4  # factor that the fits begin with


def rig(study: dict) -> Recording:
    """Out of contact, down at the source's speed, held; force and markers at their rates, no measurement yet."""
    body, place = study["lobe"](), np.array(study["SITES"][SITE][1])
    dots = study["rig"](body, SITE, tuple(place)).channels["markers"].values[0]
    down = (GAP + study["DEPTH"]) / study["SPEED"]
    t = np.arange(0, 2 * CALM + down, 0.01)
    top = float(body.top.ev(*body.parameters_of(place))) + study["RADIUS"]
    z = top + np.interp(t, [0, CALM, CALM + down], [GAP, GAP, -study["DEPTH"]])
    path = np.stack([*np.broadcast_to(place[:, None], (2, len(t))), z], 1)
    ft, mt = np.arange(0.016, t[-1], 1 / study["FORCE_RATE"]), np.arange(0.02, t[-1], 1 / study["MARKER_RATE"])
    channels = {
        "force": Channel(ft, np.zeros((len(ft), 3)), "N", study["FORCE_NOISE"]),
        "markers": Channel(mt, np.tile(dots, (len(mt), 1, 1)), "m", study["MARKER_NOISE"]),
    }
    inputs = {"probe/time": t, "probe/position": path}
    return Recording(NAME, "probing", inputs, channels, {"probe/radius": study["RADIUS"]})


def motion(sine: float, cosine: float, frequency: float) -> dict[str, float]:
    """The support's lift as values of the model, m and 1/s."""
    return {f"effects.support-motion.{k}": v for k, v in (("sin", sine), ("cos", cosine), ("frequency", frequency))}


def site_model(moves: bool) -> Model:
    """The law in vivo of the site, on a support that moves or not."""
    energy = published(LAW).energy
    return Model(energy, volumetric("quadratic"), (SupportMotion(separate=False),) if moves else ())


def constants(study: dict, factor: float) -> dict[str, float]:
    """Its constants, all moduli times a factor."""
    return {f"energy.{k}": factor * v for k, v in published(LAW).constants.items()} | {"volumetric.K": study["K"]}


def recorded(study: dict, span: float) -> tuple[Sample, Recording]:
    """The recording of a lift over `span`, m, with the sensors' noise, and without; the study's finer mesh."""
    blank = rig(study)
    sample = Sample("lobe", {NAME: blank}, columns(study["lobe"](), (16, 14, 6)), 1060.0)
    values = constants(study, 1.0) | motion(*(span / 2 * np.array([np.cos(PHASE), np.sin(PHASE)])), FREQUENCY)
    p = predictor(site_model(True), sample, settings=study["TRUTH"].changed(compression=8.0, processes=1))
    told = p.predict(values)[NAME]
    rng = np.random.default_rng([2012, 226])
    return Sample("lobe", {NAME: study["noisy"](blank, told, rng)}, sample.geometry, 1060.0), told


def read_off(sample: Sample) -> tuple[float, float, float]:
    """Sine and cosine of the lift, m, and frequency, 1/s: a sine through the markers' mean height before contact."""
    series = sample.recordings[NAME].channels["markers"]
    calm = series.time < CALM
    t, z = series.time[calm], series.values[calm, :, 2].mean(1)

    def wave(t, sine, cosine, frequency, level):
        angle = 2 * np.pi * frequency * t
        return level + sine * np.sin(angle) + cosine * np.cos(angle)

    sine, cosine, frequency, _ = curve_fit(wave, t, z, p0=(1e-3, 1e-3, 2 / CALM, z.mean()))[0]
    return float(sine), float(cosine), float(frequency)


def fitted(study: dict, sample: Sample, moved: dict[str, float]) -> dict:
    """The factor on the moduli that fits the force, and what is left: N, and mm by marker (eq. 2.2, 2.3)."""
    p = predictor(site_model(bool(moved)), sample, settings=study["FIT"].changed(compression=10.0))
    real, factor = np.asarray(sample.recordings[NAME].channels["force"].values)[:, 2], OFF
    for _ in range(TURNS):
        told = p.predict(constants(study, factor) | moved)[NAME]
        there = np.asarray(told.channels["force"].values)[:, 2]
        factor *= float(real @ there / (there @ there))
    told = p.predict(constants(study, factor) | moved)[NAME]
    apart = {c: np.asarray(told.channels[c].values) - ch.values for c, ch in sample.recordings[NAME].channels.items()}
    marker = 1e3 * np.sqrt((apart["markers"] ** 2).sum(2).mean(0))
    return {
        "factor": factor,
        "force_rmse_N": float(np.sqrt((apart["force"] ** 2).sum(1).mean())),
        "marker_rmse_mm": marker.tolist(),
        "marker_mean_mm": float(marker.mean()),
    }


def breathing(study: dict) -> dict:
    """What breathing of 4 mm does to force and markers without noise, what is read of it, and the fits.

    `still` is a fit to a recording without breathing: what it is off by is the fit's coarser mesh.
    """
    sample, clean = recorded(study, RANGE)
    series, force = clean.channels["markers"], clean.channels["force"]
    height = 1e3 * np.asarray(series.values)[:, NEAREST, 2]
    held = series.time > series.time[-1] - 2 / FREQUENCY
    push = np.asarray(force.values)[force.time > force.time[-1] - 2 / FREQUENCY, 2]
    sine, cosine, frequency = read_off(sample)
    return {
        "marker_range_before_mm": float(np.ptp(height[series.time < CALM])),
        "marker_range_held_mm": float(np.ptp(height[held])),
        "marker_moved_by_probe_mm": float(height[series.time < CALM].mean() - height[held].mean()),
        "force_held_N": [float(push.min()), float(push.max())],
        "read_range_mm": 2e3 * float(np.hypot(sine, cosine)),
        "read_frequency_1_s": frequency,
        "with breathing": fitted(study, sample, motion(sine, cosine, frequency)),
        "without": fitted(study, sample, {}),
        "still": fitted(study, recorded(study, 0.0)[0], motion(0.0, 0.0, FREQUENCY)),
        "time_s": series.time.tolist(),
        "marker_height_mm": height.tolist(),
        "force_time_s": force.time[::4].tolist(),
        "force_N": np.asarray(force.values)[::4, 2].tolist(),
    }

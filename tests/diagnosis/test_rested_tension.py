"""The commonest test of a laboratory: one ramp and hold of a rested specimen that relaxes and was a little loose in its
grips, the true base given. Both effects are in the catalogue, and each hides the other."""

import numpy as np
import pytest

from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.recordings.recording import Channel, Recording, Sample

MU, B, SHARE, TAU, GAP = 4000.0, 3.0, 0.35, 8.0, 0.024
NOISE = 20.0


def stress(stretch, time):
    """Nominal stress of a relaxing, incompressible Demiray block behind a gap, Pa; quasi-linear, exact on ramps."""
    l = 1 + np.maximum(stretch - 1 - GAP, 0)
    trace = l**2 + 2 / l
    slope = MU * np.exp(B * (trace - 3))
    out = []
    for s in (slope * (1 - trace / (3 * l**2)), slope * (1 - trace * l / 3)):
        h = np.zeros_like(s)
        for k, dt in enumerate(np.diff(time)):
            keep = np.exp(-dt / TAU)
            h[k + 1] = keep * h[k] + (1 - keep) * TAU / dt * (s[k + 1] - s[k])
        out.append(s - SHARE * (s - h))
    return l * out[0] - out[1] / l**2


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_relaxation_and_slack_are_found_together(seed):
    """Beside relaxation alone a small step of the gap gains nothing, since the law has taken up the rest: the pair has
    to be begun where the gap stood alone; in the second draw another form of slack promises more by its first step."""
    rng, time = np.random.default_rng(seed), (np.arange(0, 60, 0.2), np.arange(900) * 0.1)[seed]
    stretch = 1 + 0.2 * np.clip(time / 10, 0, 1)
    values = stress(stretch, time) + NOISE * rng.normal(size=len(time))
    inputs = {"time": time, "stretch": stretch}
    recording = Recording("r1", "uniaxial", inputs, {"nominal_stress": Channel(time, values, "Pa", NOISE)}, {})
    found = diagnose(Sample("rest", {"r1": recording}), "demiray", effects=["viscoelasticity", "slack", "energy-form"])
    told = found.as_dict()
    assert {e["name"] for e in told["effects"]} == {"viscoelasticity", "slack"}
    gap = next(e for e in told["effects"] if e["name"] == "slack")["parameters"]["effects.slack.gap"]
    assert abs(gap["value"] - GAP) < 4 * gap["std"] < 0.008
    left = {k: told[k]["r1"]["nominal_stress"]["rmse"] ** 2 - NOISE**2 for k in ("before", "after")}
    assert abs(told["explained"]["fitted"] - (1 - max(left["after"], 0) / left["before"])) < 0.01  # 0 when nothing is
    assert told["explained"]["held_out"] is None  # held out, and the fitted recordings' share was that of those
    values = told["base_parameters"]["energy.mu"]
    low, high = values["after_interval"]
    assert low < MU < high
    assert values["after"] == pytest.approx(MU, rel=0.05)
    relaxing = next(e for e in told["effects"] if e["name"] == "viscoelasticity")["parameters"]
    gone = sum(p["value"] for path, p in relaxing.items() if path.split(".")[-1].startswith("g"))
    assert values["after"] * (1 - gone) == pytest.approx(MU * (1 - SHARE), rel=0.05)

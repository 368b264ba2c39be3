"""What any model leaves of probings: forces and markers err apart, and each kind of rest is seen as what it is."""

from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.diagnosis.judgement.blocks import blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Widths, amplitudes
from tissuejax.diagnosis.judgement.particular import SIMULATED
from tissuejax.diagnosis.probing_discrepancy import probing_discrepancy
from tissuejax.estimation.series import Segment

NOISE = {"force": 0.007, "markers": 0.02}  # of the largest value, as in careful recordings


@pytest.fixture(scope="module")
def presses():
    """Two presses with a force and four markers, in units of the largest force and displacement."""
    rng, segments, truth, sigma, at = np.random.default_rng(1), [], [], [], 0
    markers = [f"marker {i} {a}" for i in range(4) for a in "xyz"]
    for name in ("r1", "r2"):
        for channel, n, components in (("force", 400, list("xyz")), ("markers", 120, markers)):
            time = np.linspace(0, 11.0, n)
            depth = np.interp(time, [0, 2, 5, 7, 9, 11], [0, 0, 5e-3, 5e-3, 0, 0])
            for c in components:
                rows, at = slice(at, at + n), at + n
                segments.append(Segment(name, channel, c, rows, time, "N", depth, "depth", "m"))
                truth.append((depth / 5e-3) ** 1.5 * (1.0 if c in ("z", "marker 0 z") else rng.uniform(0.1, 0.5)))
                sigma.append(np.full(n, NOISE[channel]))
    view = SimpleNamespace(numbers=SIMULATED, segments=segments, y=np.concatenate(truth), sigma=np.concatenate(sigma))
    return view, view.y.copy()


def left(presses, added, seed=0):
    """Amplitudes of the parts, by name, where `added` (a long vector) and noise are left of the truth."""
    view, truth = presses
    cut = blocks(view, SIMULATED.means)
    parts = probing_discrepancy(view, cut).about(cut.mean(truth))
    edges = np.flatnonzero(np.diff(cut.owner, prepend=-1))
    rows = tuple(slice(int(a), int(b)) for a, b in zip(edges, [*edges[1:], len(cut.starts)], strict=True))
    noise = view.sigma * np.random.default_rng(seed).standard_normal(len(truth))
    force = np.array([view.segments[k].channel == "force" for k in cut.owner])
    modulus = cut.mean(truth) * force  # a factor common to the moduli: of the forces, and no marker feels it
    linear = Linear(cut.mean(added + noise), modulus[:, None], np.zeros(1), np.zeros(1))
    widths = np.array([Criteria().shares[p.family] for p in parts])
    priors = Widths(widths, np.zeros(len(parts)))
    v, _ = amplitudes(linear, parts, priors, Blocked(rows, cut.spread(view.sigma)), widths**2)
    return {p.name: float(np.sqrt(x)) for p, x in zip(parts, v, strict=True)}, parts, cut


def test_noise_leaves_no_part_of_note(presses):
    found, parts, cut = left(presses, np.zeros(len(presses[1])))
    assert max(found.values()) < 0.006
    families = {"law", "gain", "hysteresis", "onset", "slow", "marker", "marker gain", "crosstalk", "white"}
    assert {p.family for p in parts} == families
    for part in parts:
        if part.within is not None:
            assert sum(len(b) for b in part.within) == len(cut.starts)
            assert all(np.linalg.eigvalsh(b).min() > -1e-9 for b in part.within)


def test_a_force_of_another_gain_is_the_force_and_not_the_markers(presses):
    view, truth = presses
    added = np.zeros(len(truth))
    for s in view.segments:
        if s.recording == "r2" and s.channel == "force":
            added[s.rows] = 0.05 * truth[s.rows]
    found, *_ = left(presses, added)
    assert max(found["gain"], found["own law"]) > 0.015
    assert max(v for k, v in found.items() if k.endswith("of markers") or k == "marker") < 0.006


def test_a_misplaced_marker_is_its_own_and_no_law_of_the_force(presses):
    view, truth = presses
    added = np.zeros(len(truth))
    for s in view.segments:
        if s.component.startswith("marker 0"):
            added[s.rows] = 0.1 * truth[s.rows]
    found, *_ = left(presses, added)
    assert found["marker"] > 0.02
    force = ("law", "fine law", "gain", "own law", "quick", "slow", "lasting")
    assert max(found[k] for k in force) < 0.006


def test_parts_that_scale_with_a_force_hold_no_constant_share_of_it(presses):
    view, truth = presses
    cut = blocks(view, SIMULATED.means)
    force = np.array([view.segments[k].channel == "force" for k in cut.owner])
    alike = np.where(force, cut.mean(truth) / cut.spread(view.sigma) ** 2, 0.0)
    size = np.linalg.norm(alike)
    scaling = [p for p in left(presses, 0 * truth)[1] if p.family in ("law", "gain", "onset")]
    assert {p.name for p in scaling} >= {"law", "fine law", "gain", "own law", "onset", "law of markers"}
    for part in scaling:
        if part.name != "crosstalk":
            assert np.max(np.abs(alike @ part.factor)) < 1e-9 * size * np.linalg.norm(part.factor)


def test_a_loop_of_the_vertical_force_alone_is_hysteresis(presses):
    """A twentieth more on the way down, less on the way back; lateral forces have their own small share of it."""
    view, truth = presses
    added = np.zeros(len(truth))
    for s in view.segments:
        if s.channel == "force":
            down = np.where(s.time <= 5.0, 1.0, np.interp(s.time, [7.0, 7.2], [1.0, -1.0]))
            added[s.rows] = 0.05 * down * truth[s.rows]
    found, parts, _ = left(presses, added)
    assert max(v for k, v in found.items() if k.startswith("hysteresis")) > 0.02
    assert max(v for k, v in found.items() if k.endswith("of markers") or k == "marker") < 0.006
    for part in parts:
        if part.family == "hysteresis":
            depth = np.concatenate([s.drive for s in view.segments])
            cut = blocks(view, SIMULATED.means)
            assert np.max(np.abs(part.factor[cut.mean(depth) == 0])) < 1e-12  # none out of contact

"""The discrepancy of probings: what any model leaves of their forces and markers.

What scales with the predicted force is orthogonal to a constant share of all forces, for that is a factor common to the
moduli: an amplitude and a parameter that do the same leave the parameter to whatever else moves it a little.

Source: orthogonal Gaussian processes, Plumlee 2017, J. Am. Stat. Assoc. 112.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.probing_view import ProbingView
from tissuejax.estimation.discrepancy import Part, loading_states, smooth_factor
from tissuejax.estimation.smoothness import USUAL, Smoothness


@dataclass(frozen=True)
class ProbingDiscrepancy:
    """What any model leaves of probings; forces and markers err apart, so each part has an amplitude of its own.

    Attributes:
        shaped: name, family and factors about a prediction of one, of the parts that scale with what is predicted.
        fixed: the parts that don't.
        sigma: noise of each block.
        force: by block, whether it is one of a force.
        crossed: blocks of a lateral force, and of the vertical one of the same recording, both with their times.
    """

    shaped: tuple[tuple[str, str, Float[np.ndarray, "M r"]], ...]
    fixed: tuple[Part, ...]
    sigma: Float[np.ndarray, " M"]
    force: Bool[np.ndarray, " M"]
    crossed: tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], ...] = ()

    def about(self, prediction: Float[np.ndarray, " M"]) -> tuple[Part, ...]:
        """The parts beside this prediction; always in the same order.

        Those of a force are orthogonal to a constant share of all forces, under the noise.
        """
        weight = np.where(self.force, (prediction / self.sigma) ** 2, 0.0)
        weight /= max(float(np.sum(weight)), 1e-300)
        shaped = [
            Part(name, family, prediction[:, None] * (f - self.force[:, None] * (weight @ f)))
            for name, family, f in self.shaped
        ]
        if self.crossed:
            factor = np.zeros((len(prediction), len(self.crossed)))
            for column, (rows, time, vertical, clock) in zip(factor.T, self.crossed, strict=True):
                column[rows] = np.interp(time, clock, prediction[vertical])
            shaped.append(Part("crosstalk", "crosstalk", factor))
        return (*shaped, *self.fixed)


def probing_discrepancy(view: ProbingView, cut: Blocks, smooth: Smoothness = USUAL) -> ProbingDiscrepancy:
    """The discrepancy of probings, in the families of material tests and one of each marker's own.

    Law: smooth in depth times the prediction, common to all recordings. Gain, own law: of each recording's own. Onset:
    of each recording's own too, a surface that is met too early or late, by a share of the depth (facets, softness of
    contact, how well the body is placed): of a force like depth^n, n times that over the depth. None of them holds a
    constant share of all forces (see `ProbingDiscrepancy.about`). Gains of markers are a family of their own.
    Hysteresis: a share of the predicted force too, of each axis alike (in units of the largest force it would be as
    large along the axes that feel nothing), with none out of contact. Slow wander: in units of the channel's largest
    value. Marker: smooth in depth times what the marker moved, of each component's own, since a marker is not quite
    where it was registered. Crosstalk: a share of the vertical force in a lateral one, as load cells of several axes
    have it, and meshes that are not symmetric.
    """
    segments, numbers = view.segments, view.numbers
    rows = [np.flatnonzero(cut.owner == k) for k in range(len(segments))]
    depth, time = cut.mean(_joined(view, "drive")), cut.mean(_joined(view, "time"))
    span = float(np.ptp(depth)) or 1.0
    channel = np.array([segments[k].channel for k in cut.owner])
    recording = np.array([segments[k].recording for k in cut.owner])
    grid = np.linspace(depth.min(), depth.max(), numbers.knots)

    def smooth_in_depth(length: float) -> Float[np.ndarray, "M r"]:
        known = smooth_factor(grid[:, None], length)
        return np.stack([np.interp(depth, grid, f) for f in known.T], axis=1)

    wide, fine, alike = (
        smooth_in_depth(length) for length in (smooth.law["law"], smooth.law["fine law"], smooth.turning)
    )
    states = np.zeros((len(cut.starts), len(smooth.states)))
    for k, s in enumerate(segments):
        own = Blocks(cut.starts[rows[k]] - s.rows.start, cut.counts[rows[k]], np.zeros(0, int))
        states[rows[k]] = own.mean(loading_states(s.drive, smooth))
    shaped, fixed = [], []
    for c in dict.fromkeys(channel.tolist()):
        inside = (channel == c)[:, None]
        of = "" if c == "force" else f" of {c}"
        each = [inside * (recording == r)[:, None] for r in dict.fromkeys(recording.tolist())]
        shaped.append((f"law{of}", "law", wide * inside))
        gain = "gain" if c == "force" else "marker gain"  # sites and load cells differ by nothing that cameras see
        shaped.append((f"gain{of}", gain, np.concatenate(each, axis=1).astype(float)))
        shaped.append((f"own law{of}", gain, np.concatenate([wide * e for e in each], axis=1)))
        if c == "force":
            onset = numbers.steep * span / (np.maximum(depth, 0.0) + numbers.touching * span)
            shaped.append(("onset", "onset", np.concatenate([onset[:, None] * e for e in each], axis=1)))
            shaped.append(("fine law", "law", fine * inside))
            for i, shape in enumerate(smooth.states):
                shaped.append((f"hysteresis, {shape}", "hysteresis", alike * inside * states[:, i, None]))
        for name, share in smooth.slow.items():
            if c == "force" or name == "lasting":
                fixed.append(Part(f"{name}{of}", "slow", within=_within(rows, inside, _wander(time, share))))
        sigma = cut.spread(view.sigma)
        scatter = [np.diag((sigma[o] / max(float(np.median(sigma[o])), 1e-300)) ** 2) * inside[o[0]] for o in rows]
        fixed.append(Part(f"white{of}", "white", within=tuple(scatter)))
    if (channel == "markers").any():
        travel = np.concatenate([_travel(view, s) for s in segments])
        moved = cut.mean(travel)

        def marker(o: np.ndarray) -> np.ndarray:
            near = np.exp(-0.5 * ((depth[o][:, None] - depth[o]) / span / smooth.law["law"]) ** 2)
            return near * np.outer(moved[o], moved[o])

        fixed.append(Part("marker", "marker", within=_within(rows, (channel == "markers")[:, None], marker)))
    upright = {s.recording: k for k, s in enumerate(segments) if (s.channel, s.component) == ("force", "z")}
    crossed = []
    for k, s in enumerate(segments):
        if s.channel == "force" and s.component != "z" and s.recording in upright:
            z = rows[upright[s.recording]]
            crossed.append((rows[k], time[rows[k]], z, time[z]))
    return ProbingDiscrepancy(tuple(shaped), tuple(fixed), cut.spread(view.sigma), channel == "force", tuple(crossed))


def _within(rows, inside, block) -> tuple[Float[np.ndarray, "n n"], ...]:
    return tuple(block(o) * inside[o[0]] for o in rows)


def _wander(time: Float[np.ndarray, " M"], share: float):
    def block(o: np.ndarray) -> np.ndarray:
        elapsed = time[o] / (float(np.ptp(time[o])) or 1.0)
        return np.exp(-np.abs(elapsed[:, None] - elapsed) / share)

    return block


def _joined(view: ProbingView, what: str) -> Float[np.ndarray, " N"]:
    return np.concatenate([getattr(s, what) for s in view.segments])


def _travel(view: ProbingView, s) -> Float[np.ndarray, " n"]:
    """How far a marker has moved, all components, in units of the largest displacement; 0 for a force."""
    if s.channel != "markers":
        return np.zeros(len(s.time))
    marker = s.component.rsplit(" ", 1)[0]
    own = [o for o in view.segments if o.recording == s.recording and o.component.rsplit(" ", 1)[0] == marker]
    return np.sqrt(sum(np.interp(s.time, o.time, view.y[o.rows]) ** 2 for o in own))

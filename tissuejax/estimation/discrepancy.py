"""What a model leaves of real recordings though no physics is missing that has a name: a Gaussian process with parts.

    y = f(theta) + d + noise,     d ~ GP(0, sum_k a_k^2 B_k),

the model of Kennedy and O'Hagan (2001), with the parts that rests of material tests are seen to have:

| part | form of B |
|---|---|
| law | squared exponential in strain (0.5 and 0.12 of the range) times the stress, shared by the series of a mode |
| gain | constant times the stress, of each recording's own (specimens differ in stiffness, load cells in gain) |
| own law | squared exponential in strain (0.5) times the stress, of a recording's own where several share a law |
| hysteresis | squared exponential in strain (0.4) times a loading state, in three shapes, shared by a mode |
| added law | what hysteresis is where nothing turns round: smooth in strain times the peak |
| slow | exponential in time (0.05, 0.25 and 1.5 of the recording), of each recording's own |
| waning gain | the stress times exponential in time (0.5 of the recording): stiffness that comes and goes, or is lost |
| white | what scatters from sample to sample beyond the stated noise |
| effects | squared exponential (0.5) in strain, and in log time if its law knows time, times what an effect does |
| zero | the stress's slope in strain, over its range: where the strain of each series counts from |
| clock | the stress's slope in time, times that between two samples: by whose clock each recording's force is read |
| sudden | what happens at once, where a judgement has found that something may have (`estimation.sudden`) |

Amplitudes a_k are shares of the stress that the model predicts (law, gain, waning gain), of its peak in the recording
(hysteresis), or of the measured peak there (slow, white); of the range of the strain (zero); samples (clock). Of what
the model predicts: about the stress of another model a gain could bring that model's answer in, and about the measured
peak a part that all specimens share would carry how they differ. Lengths and times are those of `Smoothness`.

Source: Kennedy and O'Hagan 2001, J. R. Statist. Soc. B 63; the loading state: Krasnosel'skii and Pokrovskii 1989.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.smoothness import USUAL, Smoothness
from tissuejax.estimation.sudden import Disturbed, Moment, Timed

LEFT_OUT = 1e-5  # of the largest eigenvalue: what smooth parts are cut off at


@dataclass(frozen=True)
class Series:
    """One series of measurements, as the discrepancy sees it.

    Attributes:
        recording: it belongs to.
        mode: series that share a law: extension or shear; of a base that knows directions, kind, direction, component.
        time: s.
        strain: ln stretch or shear: along its own direction and the second one.
        states: loading states (`loading_states`), one column a shape.
        peak: typical largest stress of its recording, Pa.
        start: when its recording began, s on the session's clock; all alike where the order is not known.
        sampled: time between two of its samples, s.
    """

    recording: str
    mode: Hashable
    time: Float[np.ndarray, " n"]
    strain: Float[np.ndarray, "n k"]
    states: Float[np.ndarray, "n w"]
    peak: float
    start: float = 0.0
    sampled: float = 0.0


@dataclass(frozen=True)
class Part:
    """One part of the discrepancy: its covariance is share^2 times B, of one of two forms.

    Attributes:
        name: e.g. "gain", "hysteresis, wide".
        family: "law", "gain", "hysteresis", "added law", "slow", "white", "effect", "zero", "clock" or "sudden".
        factor: B = factor factor' (smooth parts have few columns), or None.
        within: B is block-diagonal, a block for each series; or None.
    """

    name: str
    family: str
    factor: Float[np.ndarray, "N r"] | None = None
    within: tuple[Float[np.ndarray, "_ _"], ...] | None = None


def loading_states(strain: Float[np.ndarray, " n"], smooth: Smoothness = USUAL) -> Float[np.ndarray, "n w"]:
    """Where a series is between loading (1) and unloading (-1), in each of `Smoothness.states`; 0 before it has moved.

    h' = |x'| (sign x' - h) / w along the path, w a share of the range: it depends on the order of strains alone, not
    on their rate (a play operator takes out what trembles by less than `Smoothness.band`).
    """
    span = float(np.ptp(strain)) or 1.0
    band, played = smooth.band * span, np.empty(len(strain))
    at = float(strain[0])
    for i, x in enumerate(strain.tolist()):
        at = min(max(at, x - band), x + band)
        played[i] = at
    step = np.diff(played, prepend=played[0]) / span
    widths = np.array(list(smooth.states.values()))
    out, h = np.zeros((len(strain), len(widths))), np.zeros(len(widths))
    for i in np.flatnonzero(step):
        h = np.sign(step[i]) + (h - np.sign(step[i])) * np.exp(-abs(step[i]) / widths)
        out[i] = h
    last = np.maximum.accumulate(np.where(step != 0, np.arange(len(step)), -1))
    return np.where(last[:, None] >= 0, out[np.maximum(last, 0)], 0.0)


def turned(states: Float[np.ndarray, "n w"]) -> bool:
    """Whether a series turned round: its narrowest state has come to either side."""
    return bool(np.min(states[:, 0]) < 0 < np.max(states[:, 0]))


def smooth_factor(x: Float[np.ndarray, "n k"], length: float) -> Float[np.ndarray, "n r"]:
    """U with U U' = exp(-1/2 |x - x'|^2 / length^2), to `LEFT_OUT` of the largest eigenvalue; x over its range."""
    x = x / max(float(np.max(np.ptp(x, axis=0))), 1e-12)
    matrix = np.exp(-0.5 * np.sum((x[:, None] - x[None]) ** 2, axis=-1) / length**2)
    values, vectors = np.linalg.eigh(matrix)
    kept = values > LEFT_OUT * values[-1]
    return vectors[:, kept] * np.sqrt(values[kept])


def _passed(time: Float[np.ndarray, " n"], begun: float) -> Float[np.ndarray, " n"]:
    """Time since the first sample on a scale of its logarithm, from 0 to 1."""
    elapsed = (time - time[0]) / (float(np.ptp(time)) or 1.0)
    return np.log1p(elapsed / begun) / np.log1p(1 / begun)


@dataclass(frozen=True)
class Done:
    """What an effect does that the base model could not do in its place, Pa.

    Attributes:
        timed: whether its law knows times or rates.
        brief: whether it acts within some samples, so that what it errs by is no function of strain or time: each
            entry errs by itself.
    """

    change: Float[np.ndarray, " N"]
    timed: bool
    brief: bool = False


@dataclass(frozen=True)
class Discrepancy:
    """All parts of the discrepancy of some series; laws and gains scale with what a model predicts.

    Attributes:
        laws: factors of the laws about a stress of one, by name.
        belongs: a column for every recording, one where a row belongs to it.
        own: factors of a law of each recording's own, about a stress of one; its series of a mode share it. None of a
            recording that is alone in its mode: the law of that mode is its own.
        turning: hysteresis about a peak of one, or a law that is added where nothing turns round.
        fixed: the parts that don't depend on the prediction.
        fading: of a gain that changes in time, by series, how alike two samples are; none where time says nothing.
        nearly: factors of what the law of an effect errs by, about a change of the stress of one: smooth in strain,
            shared by the series of a mode, and a gain of each recording's own. in_time: the same of a law that knows
            time, smooth in strain and in the logarithm of time.
        timed: when each row was measured; None where neither what was set before a recording began nor what happens at
            once is looked for.
        sampled: by row, the time between two samples as a share of its series' duration; None where time says nothing.
        sudden: what may have happened at once.
    """

    laws: tuple[tuple[str, Float[np.ndarray, "N _"]], ...]
    belongs: Float[np.ndarray, "N R"]
    own: Float[np.ndarray, "N q"]
    turning: tuple[Part, ...]
    fixed: tuple[Part, ...]
    fading: tuple[Float[np.ndarray, "_ _"], ...]
    nearly: Float[np.ndarray, "N e"]
    in_time: Float[np.ndarray, "N f"]
    timed: Timed | None = None
    sampled: Float[np.ndarray, " N"] | None = None
    sudden: tuple[Moment, ...] = ()

    def about(self, prediction: Float[np.ndarray, " N"], done: Sequence[Done] = ()) -> tuple[Part, ...]:
        """The parts beside this prediction, Pa; always in the same order.

        Args:
            done: what the effects in it do.
        """
        stress = prediction[:, None]
        laws = tuple(Part(name, "law", stress * factor) for name, factor in self.laws)
        several = (Part("gain", "gain", stress * self.belongs), Part("own law", "gain", stress * self.own))
        peak = self.belongs @ np.max(np.abs(stress) * self.belongs, axis=0)
        turning = (Part(p.name, p.family, peak[:, None] * p.factor) for p in self.turning)
        edges = np.cumsum([0, *(len(alike) for alike in self.fading)])
        waning = tuple(
            alike * np.outer(prediction[a:b], prediction[a:b])
            for alike, a, b in zip(self.fading, edges, edges[1:], strict=False)
        )
        changing = (Part("waning gain", "slow", within=waning),) if waning else ()
        errs = [_errs(d, self.in_time if d.timed else self.nearly) for d in done]
        errs = errs or [np.zeros((len(prediction), 1))]
        effects = Part("effects", "effect", np.concatenate(errs, axis=1))
        disturbed = None if self.timed is None else Disturbed(prediction, self.timed)
        before = () if disturbed is None else self._set_before(disturbed)
        once = tuple(Part(s.name, "sudden", s.factor(disturbed)) for s in self.sudden if disturbed is not None)
        return (*laws, *several, *turning, *self.fixed, effects, *changing, *before, *once)

    def _set_before(self, of: Disturbed) -> tuple[Part, ...]:
        """What was set before a recording began: where each series' strain counts from, by whose clock its force is
        read."""
        owner = of.timed.owner[:, None] == np.unique(of.timed.owner)
        zero = Part("zero", "zero", of.stiffness[:, None] * owner)
        if self.sampled is None:
            return (zero,)
        return zero, Part("clock", "clock", (of.rate * self.sampled)[:, None] * self.belongs)


def _errs(done: Done, smooth: Float[np.ndarray, "N e"]) -> Float[np.ndarray, "N _"]:
    """Factors of what an effect's law errs by, about what it does."""
    if done.brief and np.any(done.change):
        return np.diag(done.change)[:, done.change != 0]
    return done.change[:, None] * smooth


def discrepancy(
    series: Sequence[Series],
    sigma: Float[np.ndarray, " N"],
    paced: bool = False,
    at_once: bool = False,
    smooth: Smoothness = USUAL,
) -> Discrepancy:
    """The discrepancy of these series, stacked in their order.

    Args:
        sigma: noise of each entry, Pa; entries that are means of more samples scatter less.
        paced: whether time is more than a function of the strain: else a gain that wanes is a law of each recording's
            own, and that part is left out, and what an effect's law errs by is smooth in strain alone.
        at_once: whether what was set before a recording began and what happens at once is looked for.
        smooth: lengths and times; of the series' loading states too.
    """
    of = np.repeat(np.arange(len(series)), [len(s.time) for s in series])
    states = np.concatenate([s.states for s in series])

    def shared(length: float, labels: Sequence[Hashable], timed: bool = False) -> Float[np.ndarray, "N r"]:
        """Factors side by side, of the series of each label: smooth in strain, or in it and in the logarithm of time,
        one function for all of them; none where there is no label."""
        columns = [np.zeros((len(of), 0 if any(label is not None for label in labels) else 1))]
        for label in dict.fromkeys(label for label in labels if label is not None):
            members = np.array([i for i, other in enumerate(labels) if other == label])
            x = np.concatenate([series[i].strain for i in members])
            if timed:
                passed = np.concatenate([_passed(series[i].time, smooth.begun) for i in members])
                x = np.column_stack([x / (float(np.max(np.ptp(x, axis=0))) or 1.0), passed])
            own = smooth_factor(x, length)
            whole = np.zeros((len(of), own.shape[1]))
            whole[np.isin(of, members)] = own
            columns.append(whole)
        return np.concatenate(columns, axis=1)

    recordings = list(dict.fromkeys(s.recording for s in series))
    belongs = np.array([recordings.index(s.recording) for s in series])[of]
    modes = [s.mode for s in series]
    near, out = shared(smooth.turning, modes), []
    kind = "hysteresis" if any(turned(s.states) for s in series) else "added law"
    turning = tuple(Part(f"{kind}, {shape}", kind, near * states[:, i, None]) for i, shape in enumerate(smooth.states))
    shares = [s.time / (float(np.ptp(s.time)) or 1.0) for s in series]
    apart = [np.abs(elapsed[:, None] - elapsed) for elapsed in shares]  # of the recording's duration
    for name, time in smooth.slow.items():
        alike = (s.peak**2 * np.exp(-d / time) for s, d in zip(series, apart, strict=True))
        out.append(Part(name, "slow", within=tuple(alike)))
    scatter = []
    for i, s in enumerate(series):
        own = sigma[of == i]
        scatter.append(np.diag((s.peak * own / max(float(np.median(own)), 1e-300)) ** 2))
    out.append(Part("white", "white", within=tuple(scatter)))
    laws = tuple((name, shared(length, modes)) for name, length in smooth.law.items())
    several = {m for m in modes if len({s.recording for s in series if s.mode == m}) > 1}
    own = shared(smooth.law["law"], [(s.recording, s.mode) if s.mode in several else None for s in series])
    belongs_to = (belongs[:, None] == np.arange(len(recordings))).astype(float)
    sampled = np.array([s.sampled / (float(np.ptp(s.time)) or 1.0) for s in series])[of]
    return Discrepancy(
        laws,
        belongs_to,
        own,
        turning,
        tuple(out),
        tuple(np.exp(-d / smooth.waning) for d in apart if paced),
        np.concatenate([shared(smooth.law["law"], modes), belongs_to], axis=1),
        np.concatenate([shared(smooth.law["law"], modes, timed=paced), belongs_to], axis=1),
        _timed(series, of, belongs, smooth) if at_once else None,
        sampled if paced else None,
    )


def _timed(series: Sequence[Series], of: np.ndarray, belongs: np.ndarray, smooth: Smoothness) -> Timed:
    time, strain = (np.concatenate(x) for x in ([s.time for s in series], [s.strain[:, 0] for s in series]))
    names = tuple(dict.fromkeys(s.recording for s in series))
    return Timed(time, of, belongs, names, strain, np.array([s.start for s in series])[of], smooth)

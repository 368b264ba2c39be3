"""What to measure next: the protocol whose predicted outcomes differ most between the explanations that are left.

For explanations A and B and a protocol, let d be the difference of their predictions over noise, J the sensitivity of
everything B may adjust, old recordings included. What B can't absorb,

    D = min over x of |d - J x|^2,

is the chi-square that would speak against B if A were true: the discrimination of Hunter and Reiner (1965), as used for
nonlinear models by Box and Hill (1967). What any law leaves in a new recording too, smooth in strain and in time and of
its prior's size, is absorbed at that price. Protocols are variations of what was done: a hold, ten times faster or
slower, further, the other sign, cycles, another kind of test, another direction, a day later.

Of several that would settle it those of another kind of test come first: they show as well what the kinds of test that
were made are blind to, which is among no explanation that is left.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy.polynomial.legendre import legvander

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.refit import Refit
from tissuejax.energies.energy import Energy
from tissuejax.recordings.recording import Channel, Recording, Sample

SAMPLES = 500
SETTLES, HELPS = 30.0, 8.0  # chi-square: odds that no prior outweighs; that count as strong
BENDS = 4  # degree up to which what any law leaves is smooth in strain, and in time


@dataclass(frozen=True)
class Proposal:
    """One protocol and how well it would tell two explanations apart.

    Attributes:
        protocol: in words.
        between: the two explanations, as effect names.
        discrimination: chi-square that would speak against the wrong one, the smaller of both directions.
        recording: the protocol itself, ready to be simulated or run.
    """

    protocol: str
    between: tuple[str, str]
    discrimination: float
    recording: Recording

    def as_dict(self) -> dict:
        """As in `result.json`."""
        a, b = self.between
        strong = (
            "would settle it"
            if self.discrimination > SETTLES
            else "would help"
            if self.discrimination > HELPS
            else "would hardly help"
        )
        return {
            "protocol": self.protocol,
            "between": [a, b],
            "discrimination": self.discrimination,
            "sentence": f"{a} or {b}: {self.protocol} {strong} (chi-square {self.discrimination:.0f} between them).",
        }


def ramp(levels: list[float], rate: float, holds: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Time and stretch from corner to corner at one rate, with holds, on SAMPLES samples."""
    t, x = [0.0, 1.0], [1.0, 1.0]
    for level, hold in zip(levels, holds):
        t.append(t[-1] + max(abs(level - x[-1]) / rate, 1e-3))
        x.append(level)
        if hold:
            t.append(t[-1] + hold)
            x.append(level)
    time = np.linspace(0, t[-1], SAMPLES)
    return time, np.interp(time, t, x)


def protocols(sample: Sample) -> dict[str, Recording]:
    """Variations of what was done to this sample."""
    first = next(iter(sample.recordings.values()))
    stretches = [np.asarray(r.inputs["stretch"], float) for r in sample.recordings.values() if "stretch" in r.inputs]
    if not stretches:
        return {}
    top = max(float(s.max()) for s in stretches)
    low = min(float(s.min()) for s in stretches)
    high = max(top, 1.1)
    rates = [np.quantile(np.abs(np.gradient(s[:, 0] if s.ndim == 2 else s)), 0.9) for s in stretches]
    dt = float(np.median(np.diff(np.asarray(first.inputs["time"], float))))
    rate = max(float(np.median(rates)) / dt, 1e-4)
    last = max(float(r.attributes.get("start", 0.0)) for r in sample.recordings.values())
    deep = min(low, 0.8)
    taller = {"height": 2 * float(first.attributes.get("height", 0.01))}
    known = {k: v for k, v in first.attributes.items() if k in ("area", "height", "diameter", "direction")}

    def made(name: str, kind: str, path: tuple[np.ndarray, np.ndarray], **other) -> Recording:
        time, drive = path
        channel = Channel(time, np.zeros(len(time)), "Pa", 1.0)
        return Recording(
            name,
            kind,
            {"time": time, "stretch": drive},
            {"nominal_stress": channel},
            {**known, "start": last + 600.0, **other},
        )

    words = {
        "pull and hold for 60 s": ("uniaxial", ramp([high, 1.0], rate, [60.0, 10.0]), {}),
        "push and hold for 60 s": ("uniaxial", ramp([deep, 1.0], rate, [60.0, 10.0]), {}),
        "a pull ten times faster": ("uniaxial", ramp([high, 1.0], 10 * rate, [2.0, 2.0]), {}),
        "a pull ten times slower": ("uniaxial", ramp([high, 1.0], 0.1 * rate, [0.0, 10.0]), {}),
        "three growing cycles of pulling": (
            "uniaxial",
            ramp([1 + (high - 1) * s for s in (0.5, 0, 0.75, 0, 1, 0)], rate, [0.0] * 6),
            {},
        ),
        "three growing cycles of pushing": (
            "uniaxial",
            ramp([1 + (deep - 1) * s for s in (0.5, 0, 0.75, 0, 1, 0)], rate, [0.0] * 6),
            {},
        ),
        "a pull one third further": ("uniaxial", ramp([1 + 1.33 * (high - 1), 1.0], rate, [0.0, 2.0]), {}),
        "a planar test": ("planar", ramp([high, 1.0], rate, [5.0, 2.0]), {}),
        "an equibiaxial test": ("equibiaxial", ramp([1 + 0.7 * (high - 1), 1.0], rate, [5.0, 2.0]), {}),
        "the same pull along the sample's y axis": (
            "uniaxial",
            ramp([high, 1.0], rate, [2.0, 2.0]),
            {"direction": np.array([0.0, 1.0, 0.0])},
        ),
        "the first recording again a day later": (
            "uniaxial",
            ramp([high, 1.0], rate, [5.0, 2.0]),
            {"start": last + 86400.0},
        ),
        "the same pull of a specimen of twice the height": ("uniaxial", ramp([high, 1.0], rate, [0.0, 2.0]), taller),
        "a push of a specimen of twice the height": ("uniaxial", ramp([deep, 1.0], rate, [0.0, 2.0]), taller),
        "sixty seconds at rest": ("uniaxial", ramp([1.0], rate, [60.0]), {}),
    }
    return {text: made(f"p{i}", kind, path, **other) for i, (text, (kind, path, other)) in enumerate(words.items())}


def proposals(
    sample: Sample,
    energy: Energy,
    bench: MaterialBench,
    chosen: Refit,
    rival: Refit,
    most: int | None = 3,
    shares: Mapping[str, float] | None = None,
) -> list[Proposal]:
    """The protocols that tell `chosen` from `rival` best (all of them for None).

    Args:
        sample: what was recorded, to vary.
        bench: on which both were fitted.
        shares: of the stress that any law leaves ("law", "slow"; `Criteria.shares`); nothing by default.
    """
    planned = protocols(sample)
    if not planned:
        return []
    sigma = float(np.median(bench.sigma))
    made = Sample(f"{sample.name} next", {r.name: r for r in planned.values()})
    trial = MaterialBench.of(
        made, energy, tuple(made.recordings), (), dict.fromkeys(made.recordings, sigma), sizes=bench.sizes
    )
    trial.known = bench.known
    names = [called(bench, r) for r in (chosen, rival)]
    both = [trial.predict(shared(r)) for r in (chosen, rival)]
    old = [bench.jacobian(r.values, tuple(r.values), bench.fitted)[bench.mask(bench.fitted)] for r in (chosen, rival)]
    scale = bench.sigma[bench.mask(bench.fitted)][:, None]
    new = [_jacobian(trial, r) for r in (chosen, rival)]
    out = []
    for s in trial.segments:
        text = next(t for t, r in planned.items() if r.name == s.recording)
        d = (both[0] - both[1])[s.rows] / sigma
        if not np.all(np.isfinite(d)):
            continue
        left = leftover(s.drive, s.time, both[0][s.rows], shares or {}) / sigma
        sides = [against(d, o / scale, n[s.rows] / sigma, left) for o, n in zip(old, new, strict=True)]
        out.append(Proposal(text, (names[0], names[1]), min(sides), planned[text]))
    return sorted(out, key=lambda p: -p.discrimination)[:most]


def called(bench: Bench, r: Refit) -> str:
    """The effects of a fit, in words."""
    return ", ".join(dict.fromkeys(bench.candidates[k].name for k in r.keys)) or "nothing that has a name"


def leftover(
    drive: Float[np.ndarray, " n"], time: Float[np.ndarray, " n"], stress: Float[np.ndarray, " n"], shares: Mapping
) -> Float[np.ndarray, "n k"]:
    """What any law leaves beside a prediction, Pa, in columns of weight one: a share of the stress that bends with the
    drive, and a share of its peak that bends with time."""

    def bends(x: np.ndarray) -> np.ndarray:
        return legvander(2 * (x - x.min()) / (float(np.ptp(x)) or 1.0) - 1, BENDS) / np.sqrt(BENDS + 1)

    peak = float(np.max(np.abs(stress)))
    both = (shares.get("law", 0.0) * stress[:, None] * bends(drive), shares.get("slow", 0.0) * peak * bends(time))
    return np.concatenate(both, axis=1)


def settling(each: list[list[Proposal]], most: int = 3, done: Collection[str] = ()) -> list[Proposal]:
    """Of the proposals against each rival, the protocols that tell the chosen explanation from all of them best; of
    those that would settle it those first that are none of the kinds of test `done`."""
    if not each:
        return []
    out = []
    for p in each[0]:
        same = [next((q for q in other if q.protocol == p.protocol), None) for other in each]
        if all(same):
            rivals = " or ".join(dict.fromkeys(q.between[1] for q in same))
            out.append(replace(p, between=(p.between[0], rivals), discrimination=min(q.discrimination for q in same)))

    def rank(p: Proposal) -> tuple[bool, float]:
        other = bool(done) and p.discrimination > SETTLES and p.recording.experiment not in done
        return not other, -p.discrimination

    return sorted(out, key=rank)[:most]


def against(
    d: Float[np.ndarray, " n"],
    old: Float[np.ndarray, "m k"],
    new: Float[np.ndarray, "n k"],
    left_over: Float[np.ndarray, "n j"] | None = None,
) -> float:
    """What is left of d after every adjustment that the old recordings leave open, and after what any law leaves.

    Args:
        d: difference of predictions; old, new: sensitivities of the old and the new recordings; all over noise.
        left_over: what any law leaves, over noise: its columns are taken with any weight, at the price of its square.
    """
    loose = np.zeros((len(d), 0)) if left_over is None else left_over
    j = loose.shape[1]
    whole = np.block([[old, np.zeros((len(old), j))], [new, loose], [np.zeros((j, old.shape[1])), np.eye(j)]])
    norms = np.linalg.norm(whole, axis=0)
    whole = whole[:, norms > 0] / norms[norms > 0]
    right = np.concatenate([np.zeros(len(old)), d, np.zeros(j)])
    left = right - whole @ np.linalg.lstsq(whole, right, rcond=None)[0]
    return float(left @ left)


def shared(r: Refit) -> dict[str, float]:
    """Values that hold in a new recording: what belongs to one recording alone is not known there."""
    return {p: v for p, v in r.values.items() if not _own(p)}


def _own(path: str) -> bool:
    return path.startswith("effects.") and path.count(".") > 2


def _jacobian(trial: MaterialBench, r: Refit) -> np.ndarray:
    common = shared(r)
    jac = trial.jacobian(common, tuple(common))
    out = np.zeros((len(trial.y), len(r.values)))
    for i, path in enumerate(r.values):
        if path in common:
            out[:, i] = jac[:, tuple(common).index(path)]
    return out

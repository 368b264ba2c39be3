"""Benchmark: `fit` beside a plain scipy least-squares of the same law, on real recordings; the ratio of their RMSE.

    TISSUEJAX_SHARED=... python tests/bench/bench_real_baseline.py [SET ...]

The baseline is a few lines of numpy of its own: Ogden with two terms (2 mu / alpha^2) or Yeoh with three, and where
the recordings have time three Prony terms on the nominal stress whose shares sum to at most one; scipy's least_squares
from STARTS drawn starts. Ours: `tissuejax.fit` of the same law (viscoelasticity of three terms on the nominal stress),
all recordings fitted with equal weight, as it comes and with its default starts. Aim: never worse than 1.05 times.
"""

import json
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
from bench_step import machine
from scipy.optimize import least_squares

import tissuejax as tj
from tissuejax.effects.viscoelasticity import Viscoelasticity
from tissuejax.energies.catalogue import energy
from tissuejax.errors import InputError
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Sample
from tissuejax.recordings.specimens import NO_TIME
from tissuejax.storage import write_json

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "fits" / "real-panel"))
import panel_samples  # noqa: E402

SETS = (
    "beef 230327_RDG15A",
    "beef 230411_FF2B",
    "tendon fresh 1",
    "tendon incubated 1",
    "muscle relaxed",
    "muscle high calcium",
    "foam leap 4",
    "foam new-toe tension",
    "fungi 80 s cross-plane",
    "fungi cross-plane, first of each rate",
    "ecoflex EF10_100T",
    "brain cortex",
    "rubber Treloar, neo-Hooke",
    "silicone Meunier, neo-Hooke",
)
UNTIMED = ("ecoflex", "brain", "rubber", "silicone")  # one rate and no hold, or no time: elastic laws alone
STARTS, TERMS, WORSE = 6, 3, 1.05


def ogden(l: np.ndarray, kind: str, mu: float, a: float) -> np.ndarray:
    """Nominal stress of one term 2 mu / a^2 (sum l_i^a - 3) of an incompressible specimen."""
    if kind == "simple-shear":
        stretch = l / 2 + np.sqrt(1 + l**2 / 4)
        return 2 * mu / a * (stretch ** (a - 1) - stretch ** (-a - 1)) * stretch / (stretch + 1 / stretch)
    other = {"uniaxial": -a / 2, "planar": -a, "equibiaxial": -2 * a}[kind]
    return 2 * mu / a * (l ** (a - 1) - l ** (other - 1))


def yeoh(l: np.ndarray, kind: str, c: np.ndarray) -> np.ndarray:
    """Nominal stress of sum c_i (I1 - 3)^i."""
    if kind == "simple-shear":
        x, slope = l**2, 2 * l
    else:
        power = {"uniaxial": (-1, 2.0), "planar": (-2, 1.0), "equibiaxial": (-4, 0.5)}[kind]
        x = {"uniaxial": l**2 + 2 / l, "planar": l**2 + l**-2 + 1, "equibiaxial": 2 * l**2 + l**-4}[kind] - 3
        slope = 2 * (l - l ** (power[0] - 1.0))  # of I1 by stretch, halved where two directions are pulled
    return slope * sum((i + 1) * k * x**i for i, k in enumerate(c))


def faded(time: np.ndarray, s: np.ndarray, tau: float) -> np.ndarray:
    """h' = s' - h / tau from rest, exact where s runs straight between samples."""
    dt = np.diff(time)
    decay, gain = np.exp(-dt / tau), -np.expm1(-dt / tau) * tau / dt
    h = np.zeros_like(s)
    h[0] = s[0]
    for i, step in enumerate(np.diff(s)):
        h[i + 1] = decay[i] * h[i] + gain[i] * step
    return h


def relaxed(time: np.ndarray, s: np.ndarray, shares: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """s - sum g_i (s - h_i)."""
    return s - sum(g * (s - faded(time, s, t)) for g, t in zip(shares, tau))


class Plain:
    """The baseline's problem: parameters in natural scales, residuals over the rms of the stress."""

    def __init__(self, sample: Sample, law: str, timed: bool):
        self.parts, self.law, self.timed = [], law, timed
        for r in sample.recordings.values():
            drive = np.asarray(r.inputs["shear" if r.experiment == "simple-shear" else "stretch"], float)
            y = np.asarray(r.channels["nominal_stress"].values, float)
            self.parts.append((np.asarray(r.inputs["time"], float), drive, r.experiment, y))
        self.y = np.concatenate([p[3] for p in self.parts])
        self.size = np.sqrt(np.mean(self.y**2))
        self.n = 4 if law == "ogden-2" else 3
        steps = np.concatenate([np.diff(p[0]) for p in self.parts])
        self.span = (np.log(max(np.median(steps), 1e-3)), np.log(max(np.ptp(p[0]) for p in self.parts)))

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Stress of all recordings."""
        out = []
        if self.timed:
            e = np.exp(x[self.n : self.n + TERMS])
            shares, tau = e / (1 + e.sum()), np.exp(x[self.n + TERMS :])
        for t, drive, kind, _ in self.parts:
            if self.law == "ogden-2":
                s = ogden(drive, kind, self.size * x[0], x[1]) + ogden(drive, kind, self.size * x[2], x[3])
            else:
                s = yeoh(drive, kind, self.size * x[:3])
            out.append(relaxed(t, s, shares, tau) if self.timed else s)
        return np.concatenate(out)

    def rmse(self, x: np.ndarray) -> float:
        """Root mean square error, Pa."""
        return float(np.sqrt(np.mean((self.predict(x) - self.y) ** 2)))

    def solve(self) -> tuple[float, np.ndarray, float]:
        """(RMSE, parameters, seconds) of the best of STARTS starts."""
        begun, rng, best = time.perf_counter(), np.random.default_rng(0), (np.inf, np.zeros(1))
        for _ in range(STARTS):
            if self.law == "ogden-2":
                x = [rng.uniform(0.1, 3), rng.uniform(1, 12), rng.uniform(0.1, 3), -rng.uniform(1, 12)]
                low, high = [-1e4, 0.1, -1e4, -40], [1e4, 40, 1e4, -0.1]
            else:
                x, low, high = [rng.uniform(0.1, 3), 0.1, 0.1], [-1e5] * 3, [1e5] * 3
            if self.timed:
                x += [0.0] * TERMS + list(np.sort(rng.uniform(*self.span, TERMS)))
                low += [-12.0] * TERMS + [self.span[0] - 3] * TERMS
                high += [6.0] * TERMS + [self.span[1] + 3] * TERMS
            with np.errstate(all="ignore"):
                r = least_squares(self._left, x, bounds=(low, high), x_scale="jac", max_nfev=200)
            if np.isfinite(r.cost) and self.rmse(r.x) < best[0]:
                best = (self.rmse(r.x), r.x)
        return *best, time.perf_counter() - begun

    def _left(self, x: np.ndarray) -> np.ndarray:
        left = (self.predict(x) - self.y) / self.size
        return np.where(np.isfinite(left), np.clip(left, -1e6, 1e6), 1e6)


def ours(sample: Sample, law: str, timed: bool) -> tuple[float, dict, float]:
    """(RMSE, values, seconds) of the project's fit of the same law."""
    begun = time.perf_counter()
    base = energy(law, "2mu/alpha^2") if law.startswith("ogden") else energy(law)
    slow = Viscoelasticity(terms=TERMS)
    fixed = {"effects.viscoelasticity.nominal": 1.0} if timed else None
    found = tj.fit(
        sample,
        Model(base, None, (slow,) if timed else ()),
        objective=tj.Objective(weights="uniform"),
        unknowns=tj.Unknowns(fix=fixed),
    )
    squares = [(c.rmse**2 * c.n, c.n) for c in found.channels.values()]
    rmse = float(np.sqrt(sum(s for s, _ in squares) / sum(n for _, n in squares)))
    return rmse, {k: float(v) for k, v in found.values.items()}, time.perf_counter() - begun


def code() -> str:
    """The commit that is measured, as far as a checkout tells."""
    said = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return said.stdout.strip()


def bare(sample: Sample) -> Sample:
    """Without stated noise and without the remark on time, so that both minimise the plain sum of squares."""
    found = {}
    for name, r in sample.recordings.items():
        c = r.channels["nominal_stress"]
        found[name] = replace(r, channels={"nominal_stress": Channel(c.time, c.values, c.unit, None)})
    return replace(sample, recordings=found, notes=sample.notes.replace(NO_TIME, ""))


def main(wanted: list[str]) -> None:
    """Print and write the ratios; sets whose name begins with one of `wanted`."""
    causes = tomllib.loads((ROOT / "fits" / "real-panel" / "causes.toml").read_text())
    listed = {e.id: e for e in panel_samples.entries(causes)}
    path = ROOT / "tests" / "bench" / "results" / "real_baseline.json"
    rows = []
    print(f"{'set':<40}{'law':<24}{'scipy RMSE/peak':>16}{'ours':>9}{'ratio':>8}{'s':>7}{'ours s':>8}", flush=True)
    for name in SETS:
        if wanted and not any(name.startswith(w) for w in wanted):
            continue
        sample, timed = bare(panel_samples.build(listed[name])[0]), not name.startswith(UNTIMED)
        for law in ("ogden-2", "reduced-polynomial-3"):
            problem = Plain(sample, law, timed)
            rmse, at, seconds = problem.solve()
            peak = float(np.abs(problem.y).max())
            try:
                mine, values, took = ours(sample, law, timed)
            except Exception as error:  # a fit that fails is the worst ratio there is
                print(f"{name}, {law}: ours failed: {type(error).__name__}: {error}", flush=True)
                mine, values, took = np.inf, {}, 0.0
            ratio = mine / rmse
            row = {
                "set": name,
                "code": code(),
                "law": law,
                "prony_terms": TERMS if timed else 0,
                "peak_Pa": peak,
                "scipy_rmse_Pa": rmse,
            }
            rows.append(row | {"ours_rmse_Pa": mine, "ratio": ratio, "scipy_seconds": seconds, "ours_seconds": took,
                               "scipy_parameters": at.tolist(), "ours": values})  # fmt: skip
            words = law + (f" + {TERMS} Prony" if timed else "")
            print(
                f"{name[:39]:<40}{words[:23]:<24}{rmse / peak:>16.3%}{mine / peak:>9.3%}{ratio:>8.3f}",
                f"{seconds:>7.1f}{took:>8.1f}{'  WORSE' if ratio > WORSE else ''}",
                flush=True,
            )
            kept = {(r["set"], r["law"]): r for r in (json.loads(path.read_text())["rows"] if path.exists() else [])}
            kept.update({(r["set"], r["law"]): r for r in rows})  # a part that is run again replaces its own rows
            write_json(path, {"aim": WORSE, "starts": STARTS, "rows": list(kept.values()), "machine": machine()})
    ratios = np.array([r["ratio"] for r in rows])
    print(f"\n{np.sum(ratios <= WORSE)} of {len(rows)} at most {WORSE}; largest ratio {ratios.max():.3f}")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        print(f"skipped: {error}")

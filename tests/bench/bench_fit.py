"""Benchmark: fit time and model evaluations on Treloar's three modes, 3-term Ogden, from one start and in one run.

    python tests/bench/bench_fit.py

Ours: variable projection with Levenberg-Marquardt and forward-mode Jacobians. Against: scipy's least_squares with
finite differences on the very same predictor, and felupe (from PyPI) evaluating and fitting its own Ogden form. Best
of three, compiled before; a call with derivatives counts as one evaluation and, in brackets, as one plus the number
of tangents.
"""

import sys
import time
from pathlib import Path

import numpy as np
from bench_step import machine
from scipy.optimize import least_squares

import tissuejax as tj
from tissuejax.energies.ogden import convert
from tissuejax.errors import InputError
from tissuejax.experiments.predictor import predictor
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.setup import problem
from tissuejax.fitting.starts import fitted_moduli
from tissuejax.storage import write_json

ROOT = Path(__file__).parents[2]
REPEATS = 3


def timed(run):
    """Best time of a few runs, and the last result."""
    best, found = np.inf, None
    for _ in range(REPEATS):
        begun = time.perf_counter()
        found = run()
        best = min(best, time.perf_counter() - begun)
    return best, found


def ours(posed) -> dict:
    """Descent from the start, once compiled."""
    begun = time.perf_counter()
    descend(posed)
    first = time.perf_counter() - begun
    seconds, end = timed(lambda: descend(posed))
    n = end.runs
    return {
        "sse_MPa2": 2 * end.cost * scale(posed),
        "evaluations": n,
        "with_tangents": n * (1 + len(posed.free)),
        "seconds": seconds,
        "first_call_seconds": first,
    }


def scipy_differences(posed, method: str, x0) -> dict:
    """least_squares on the same residuals with two-point finite differences."""
    count = [0]

    def residuals(x):
        count[0] += 1
        return np.nan_to_num(posed.residuals(posed.values(x)), nan=1e6, posinf=1e6, neginf=-1e6)

    def run():
        count[0] = 0
        scaling = {"x_scale": "jac"}
        return least_squares(residuals, x0, method=method, max_nfev=20000 if method == "lm" else 2000, **scaling)

    begun = time.perf_counter()
    end = run()
    seconds = time.perf_counter() - begun
    return {"sse_MPa2": 2 * end.cost * scale(posed), "evaluations": count[0], "seconds": seconds, "status": end.message}


def felupe_fit(sample, start: dict[str, float]) -> dict | None:
    """scipy with finite differences on felupe's Ogden energy, whose form is 2 mu / alpha^2."""
    try:
        import felupe
        import tensortrax  # noqa: F401  (felupe's hyperelastic materials need it)
    except ImportError:
        return None
    keys = {"ux": "uniaxial", "ps": "planar", "bx": "equibiaxial"}
    data = {
        k: (np.asarray(r.inputs["stretch"]), np.asarray(r.channels["nominal_stress"].values) / 1e6)
        for k, r in ((k, sample.recordings[name]) for k, name in keys.items())
    }
    count = [0]

    def residuals(x):  # its own `optimize` mixes up planar and biaxial data in release 11.3, so scipy is called here
        count[0] += 1
        energy = felupe.Hyperelastic(felupe.ogden, mu=list(x[:3]), alpha=list(x[3:]))
        view = felupe.ViewMaterialIncompressible(energy, **{k: stretch for k, (stretch, _) in data.items()})
        found = {len(stress): stress for _, stress, _ in (row[:3] for row in view.evaluate())}
        parts = [found[len(stress)] - stress for _, stress in data.values()]  # the three lengths differ
        return np.nan_to_num(np.concatenate(parts), nan=1e6, posinf=1e6, neginf=-1e6)

    x0 = [start[f"mu{i}"] / 1e6 for i in (1, 2, 3)] + [start[f"alpha{i}"] for i in (1, 2, 3)]
    begun = time.perf_counter()
    with np.errstate(all="ignore"):
        end = least_squares(residuals, x0, x_scale="jac", max_nfev=2000)
    seconds = time.perf_counter() - begun
    return {"sse_MPa2": 2 * float(end.cost), "evaluations": count[0], "seconds": seconds, "status": end.message}


def scale(posed) -> float:
    """Residuals are in units of the noise; chi-square times this is MPa^2."""
    return (next(iter(posed.noise.std.values())) / 1e6) ** 2


def main() -> dict:
    """Run all, print a table, write tests/bench/results/fit.json."""
    try:
        sample = tj.read(f"{ROOT / 'fits' / 'rubber' / 'rubber.toml'}#Treloar_1944")
    except InputError as error:
        print(f"bench_fit: {error}", file=sys.stderr)
        return {}
    posed = problem(predictor(tj.material("ogden-3", ogden_form="mu/alpha"), sample))
    x0 = posed.vector(posed.start)
    rows = {"tissuejax": ours(posed)}
    for method in ("trf", "lm"):
        rows[f"scipy {method}, finite differences, same start"] = scipy_differences(posed, method, x0)
    near = posed.vector(fitted_moduli(posed, posed.start))
    for method in ("trf", "lm"):
        rows[f"scipy {method}, finite differences, moduli solved first"] = scipy_differences(posed, method, near)
    constants = {path.removeprefix("energy."): v for path, v in zip(posed.free, near, strict=True)}
    peer = felupe_fit(sample, convert(constants, "mu/alpha", "2mu/alpha^2"))
    if peer is None:
        print("felupe's Ogden needs tensortrax, which isn't here: pip install tensortrax")
    else:
        rows["felupe with scipy trf, moduli solved first"] = peer
    for name, row in rows.items():
        tangents = f" ({row['with_tangents']} with tangents)" if "with_tangents" in row else ""
        print(
            f"{name:<56} SSE {row['sse_MPa2'] or float('nan'):.4f} MPa^2  {row['evaluations']:>6} "
            f"evaluations{tangents}  {row['seconds']:.2f} s"
        )
    write_json(Path(__file__).parent / "results" / "fit.json", rows | {"machine": machine()})
    return rows


if __name__ == "__main__":
    main()

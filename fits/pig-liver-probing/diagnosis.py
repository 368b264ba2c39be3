"""Pig liver, diagnosed: a region is taken for one homogeneous tissue. What is missing: stiffness, or first touch?

The engine of `tissuejax diagnose` on a bench of its own: ten depths at each of many sites, the contact law of
`experiments/layer_indentation.py`, and candidates that vary from place to place.

tissuejax study fits/pig-liver-probing
"""

import copy
import csv
import os
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.judgement import answer as judged
from tissuejax.diagnosis.judgement.blocks import State, blocks, series, strain
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.errors import InputError
from tissuejax.estimation.discrepancy import discrepancy
from tissuejax.estimation.series import Segment
from tissuejax.experiments.layer_indentation import force
from tissuejax.report.page import png
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, grid
from tissuejax.storage import write_bytes, write_json

RADIUS = 4.0e-3  # m, of the ball
NOISE, SPREAD = (
    0.01,
    0.05,
)  # N, and share of the force: scatter of neighbouring steps, and what a settled step leaves open
HELD_OUT = 5  # every fifth site
CENTRES = 5  # a field is spanned by CENTRES x CENTRES bells over the region
SHALLOW = 7  # steps from which the deeper three are predicted
EFFORT = Effort(most=2)


def read(folder: Path) -> dict[str, dict[str, np.ndarray]]:
    """Depth (m), axial force (N) and place (m) of ten steps at each site of the pig liver regions."""
    path = folder / "probing_points.csv"
    if not path.exists():
        raise InputError(f"{path} is not here: set TISSUEJAX_SHARED to the folder that holds recordings/")
    rows: dict[str, dict[int, list]] = {}
    with path.open() as file:
        for r in csv.DictReader(file):
            if r["region"].startswith("pig_liver"):
                sites = rows.setdefault(r["region"].removeprefix("pig_liver_20150826_"), {})
                values = (r["depth_mm"], r["force_axial_N"], r["x_mm"], r["y_mm"])
                sites.setdefault(int(r["site"]), []).append([float(v) for v in values])
    found = {}
    for region, sites in rows.items():
        block = np.array([s for _, s in sorted(sites.items()) if len(s) == 10])
        found[region] = {"depth": 1e-3 * block[..., 0], "force": block[..., 1], "place": 1e-3 * block[:, 0, 2:]}
        found[region]["threshold"] = 0.08 if region.startswith("v2") else 0.05  # N, as the recordings say
    return found


class Sites(Bench):
    """Sites of one region: F = force(depth + touch, E, thickness, b); E, touch and thickness may be of the place."""

    @classmethod
    def of(cls, data: dict[str, np.ndarray]) -> "Sites":
        """Every fifth site is held out."""
        depth, n = data["depth"], len(data["depth"])
        held = np.arange(n) % HELD_OUT == HELD_OUT - 1
        segments = [
            Segment("held-out sites" if held[i] else "fitted sites", "force", f"site {i}", slice(10 * i, 10 * i + 10),
                    np.arange(10.0), "N", depth[i], "depth", "m")
            for i in range(n)
        ]  # fmt: skip
        y = data["force"].ravel()
        size = Free(1e2, 1e6, 1e3, "Pa", log=True)
        free = {"E": size, "b": Free(0.0, 60.0, 5.0)}
        start = {"E": 3e3, "b": 5.0}
        middle, span = data["place"].mean(axis=0), np.ptp(data["place"], axis=0).max() / 2
        bench = cls(segments, y, np.hypot(NOISE, SPREAD * y), ("fitted sites",), ("held-out sites",), ("E", "b"), free,
                    start, {})  # fmt: skip
        bench.place, bench.depth = (data["place"] - middle) / span, depth
        bench.order = np.linspace(-1, 1, n)
        at = np.linspace(-1, 1, CENTRES)
        centres = np.stack(np.meshgrid(at, at), -1).reshape(-1, 2)
        near = np.linalg.norm(bench.place[:, None] - centres, axis=2)
        centres = centres[near.min(axis=0) < 0.4]  # bells over places where nobody probed say nothing
        bells = np.exp(-0.5 * (np.linalg.norm(bench.place[:, None] - centres, axis=2) / 0.4) ** 2)
        x, y = bench.place.T
        bench.shapes = {"wedge": np.stack([x, y], 1), "field": bells, "order": bench.order[:, None]}
        bench._add("stiffness of the place", "stiffness", 0.3, ("wedge", "field"), 1.0)
        bench._add("first touch", "touch", 1e-4, ("all", "wedge", "field"), 1e-3, "m")
        bench._add("thickness", "layer", 20.0, ("all", "wedge"), 300.0, "1/m")
        bench._add("order of probing", "aging", 0.1, ("order",), 2.0)
        bench._add("sensor offset", "offset", 0.01, ("all",), 0.5, "N")
        bump = {
            "bump.x": Free(-1.2, 1.2, 0.3),
            "bump.y": Free(-1.2, 1.2, 0.3),
            "bump.size": Free(0.05, 1.0, 0.2, log=True),
        }
        bench.free |= bump | {"bump.amount": Free(-3.0, 3.0, 0.3)}
        bench.start |= {"bump.x": 0.0, "bump.y": 0.0, "bump.size": 0.3, "bump.amount": 0.0}
        bumps = tuple({"bump.x": float(c[0]), "bump.y": float(c[1]), "bump.size": 0.3} for c in centres)
        bench.candidates["inclusion"] = Candidate("inclusion", ("bump.amount",), tuple(bump), bumps)
        return bench

    def _add(self, name: str, key: str, scale: float, forms: tuple[str, ...], most: float, unit: str = "1") -> None:
        previous = None
        for form in forms:
            columns = 1 if form == "all" else self.shapes[form].shape[1]
            paths = tuple(f"{key}.{form}.{i}" for i in range(columns))
            self.free |= dict.fromkeys(
                paths, Free(-most if form != "all" or key != "layer" else 0.0, most, scale, unit)
            )
            self.start |= dict.fromkeys(paths, 0.0)
            beside = (previous,) if previous else ()
            made = Candidate(name, paths, form=form if len(forms) > 1 else "", beside=beside)
            self.candidates[made.key] = made
            previous = made.key

    def _field(self, values, key: str) -> np.ndarray:
        out = np.zeros(len(self.place))
        for path, v in values.items():
            if v and path.startswith(f"{key}."):
                _, form, i = path.split(".")
                out = out + v * (1.0 if form == "all" else self.shapes[form][:, int(i)])
        return out

    def predict(self, values, recordings=None):
        v = {**self.start, **dict(values)}
        stiff = self._field(v, "stiffness") + self._field(v, "aging")
        away = (self.place - [v["bump.x"], v["bump.y"]]) / v["bump.size"]
        stiff = stiff + v["bump.amount"] * np.exp(-0.5 * np.sum(away**2, axis=1))
        touch, layer = self._field(v, "touch")[:, None], np.maximum(self._field(v, "layer"), 0.0)[:, None]
        thickness = 1 / np.maximum(layer, 1e-6)
        made = force(jnp.asarray(self.depth + touch), RADIUS, 1.0, thickness, v["b"])
        out = v["E"] * np.exp(np.clip(stiff, -6, 6))[:, None] * np.asarray(made)
        return (out + self._field(v, "offset")[:, None]).ravel()

    def jacobian(self, values, paths, recordings=None):
        at = {**{p: self.start[p] for p in paths}, **values}
        origin, out = self.predict(at), np.empty((len(self.y), len(paths)))
        for i, p in enumerate(paths):
            h = 1e-5 * max(self.free[p].scale, abs(at[p]))
            out[:, i] = (self.predict({**at, p: at[p] + h}) - origin) / h
        return out


def site_by_site(data: dict[str, np.ndarray]) -> dict:
    """One number of its own for each site: a stiffness, a first touch, or a stiffness that also says where touch was.

    The last: depth is counted from where the controller felt its threshold, so that a softer site was touched further
    above. The rest (stiffening; modulus where touch is free) is shared by the region. Fitted to the seven shallow
    steps.
    """
    depth, y = data["depth"], data["force"]
    sigma = np.hypot(NOISE, SPREAD * y)
    touches = np.linspace(-1e-3, 2e-3, 61)

    def stiffness(b: float) -> np.ndarray:
        u = np.asarray(force(jnp.asarray(depth), RADIUS, 1.0, jnp.inf, b))
        few, w = slice(0, SHALLOW), sigma[:, :SHALLOW] ** -2
        E = (w * u[:, few] * y[:, few]).sum(1) / np.maximum((w * u[:, few] ** 2).sum(1), 1e-30)
        return E[:, None] * u

    def touch(E: float, b: float) -> np.ndarray:
        made = np.stack([np.asarray(force(jnp.asarray(depth + t), RADIUS, E, jnp.inf, b)) for t in touches])
        z = ((made - y) / sigma)[..., :SHALLOW]
        return made[np.argmin((z**2).sum(2), axis=0), np.arange(len(y))]

    def threshold(b: float) -> np.ndarray:
        above = np.linspace(0, 5e-3, 400)
        grown = np.asarray(force(jnp.asarray(above), RADIUS, 1.0, jnp.inf, b))
        moduli = np.geomspace(2e2, 2e5, 90)
        first = np.interp(data["threshold"] / moduli, grown, above)
        shifted = jnp.asarray(depth + first[:, None, None])
        made = moduli[:, None, None] * np.asarray(force(shifted, RADIUS, 1.0, jnp.inf, b))
        z = ((made - y) / sigma)[..., :SHALLOW]
        return made[np.argmin((z**2).sum(2), axis=0), np.arange(len(y))]

    def shallow(prediction: np.ndarray) -> float:
        return float(np.sum((((prediction - y) / sigma)[:, :SHALLOW]) ** 2))

    bs = np.linspace(0, 60, 31)
    one = stiffness(min(bs, key=lambda b: shallow(stiffness(b))))
    start = (np.log(3e3), 10.0)
    third = threshold(min(bs, key=lambda b: shallow(threshold(b))))
    best = minimize(
        lambda p: shallow(touch(np.exp(p[0]), abs(p[1]))), start, method="Nelder-Mead", options={"maxiter": 80}
    )
    other = touch(np.exp(best.x[0]), abs(best.x[1]))

    def chi(p: np.ndarray) -> dict[str, float]:
        z = ((p - y) / sigma) ** 2
        return {"shallow": float(z[:, :SHALLOW].mean()), "deep_predicted": float(np.median(z[:, SHALLOW:].mean(1)))}

    return {
        "a stiffness of its own": chi(one),
        "a first touch of its own": chi(other),
        "a stiffness, touched at the threshold": chi(third),
    }


def answer(data: dict[str, np.ndarray]) -> tuple[dict, Sites, tuple[np.ndarray, np.ndarray]]:
    """The verdict of one region, its bench, and the predictions before and after."""
    bench = Sites.of(data)
    whole = copy.copy(bench)
    whole.fitted, whole.held_out = (*bench.fitted, *bench.held_out), ()
    cut = blocks(whole)
    states = [State("press", strain(s)[:, None]) for s in whole.segments]
    of = discrepancy(series(whole, cut, states), cut.spread(whole.sigma))
    v = judged.answer(bench, whole, cut, of, Setup(effort=EFFORT))
    mask = {n: bench.mask((n,)) for n in ("fitted sites", "held-out sites")}

    def rmse(r):
        return {n: float(np.sqrt(np.mean((bench.y - r.prediction)[m] ** 2))) for n, m in mask.items()}

    alone = {
        " + ".join(s.keys) or "one tissue": {
            "log_evidence": s.log_evidence,
            "chi2_with_all_sites": s.chi2 / s.n,
            "parameters": s.k,
        }
        for s in v.evidence.sets
    }
    record = {
        "sites": len(bench.depth),
        "verdict": v.kind,
        "effects": list(v.chosen.keys),
        "rivals": [list(r.keys) for r in v.rivals],
        "confidence": v.confidence,
        "inclusion": dict(v.judgement.inclusion),
        "explained": {"fitted": v.explained[0], "held_out": v.explained[1]},
        "before_rmse_N": rmse(v.empty),
        "after_rmse_N": rmse(v.chosen),
        "sets": alone,
        "site_by_site": site_by_site(data),
    }
    return record, bench, (v.empty.prediction, v.chosen.prediction)


def picture(answers: dict) -> bytes:
    """For each region: residual of one homogeneous tissue by site, and what is left."""
    figure, axes = grid(len(answers), 3, height=3.0)
    for ax, (region, (record, bench, told)) in zip(axes, answers.items(), strict=True):
        left = [np.sqrt(np.mean(((bench.y - p) / bench.sigma).reshape(-1, 10) ** 2, axis=1)) for p in told]
        held = np.array([s.recording == "held-out sites" for s in bench.segments])
        order = np.argsort(left[0])
        ax.plot(left[0][order], color=FAINT, label="one homogeneous tissue")
        x = np.arange(len(order))
        for mask, colour, name in ((~held, MODEL, "verdict, fitted site"), (held, HELD, "verdict, held-out site")):
            ax.plot(x[mask[order]], left[1][order][mask[order]], ".", color=colour, markersize=4, label=name)
        ax.axhline(1, color=INK, linewidth=0.6, linestyle=":")
        words = " + ".join(record["effects"]) or "nothing"
        ax.set(yscale="log", xlabel=f"{region}: sites, by misfit")
        ax.set_title(f"{record['verdict']}:\n{words}", fontsize=7.5, loc="left")
    axes[0].set_ylabel("RMS residual / noise")
    axes[0].legend(frameon=False, fontsize=8)
    return png(figure)


def main(folder: Path) -> str:
    """Write diagnosis.json and the picture; returns the answer in a sentence."""
    default = folder.resolve().parents[2] / "shared"
    data = read(Path(os.environ.get("TISSUEJAX_SHARED", default)) / "recordings" / "pig_liver_robot_probing")
    shown = {region: answer(d) for region, d in data.items()}
    records = {region: record for region, (record, *_) in shown.items()}
    write_json(folder / "diagnosis.json", records)
    write_bytes(folder / "figures" / "diagnosis.png", picture(shown))
    return "; ".join(
        f"{region}: {r['verdict']} ({', '.join(r['effects'])}), {r['explained']['held_out']:.0%} of held-out misfit"
        for region, r in records.items()
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))

"""How strongly the data support each model: Akaike weights and held-out errors as bars."""

import math
from dataclasses import dataclass
from typing import ClassVar

from matplotlib.figure import Figure

from tissuejax.estimation.ending import Ending
from tissuejax.fitting.comparison import TELLS, Comparison, Row
from tissuejax.report.plot import HELD, INK, MODEL, PAPER, Plot, tidy
from tissuejax.report.scales import display

NOTED = 2  # open directions said of a model


@dataclass(frozen=True)
class Bars:
    """One row a model: name, Akaike weight, error fitted and held out in `unit` (None where nothing was held out)."""

    names: tuple[str, ...]
    weight: tuple[float, ...]
    fitted: tuple[float, ...]
    held: tuple[float | None, ...]
    unit: str


class ComparisonBars(Plot):
    """Akaike weight left; error right."""

    name: ClassVar[str] = "support"
    subject: ClassVar[type] = Comparison
    order: ClassVar[int] = 20

    def prepare(self, subject: Comparison) -> Bars:
        """Of the channel whose unit comes first."""
        unit = next(iter(subject.rows[0].fitted))
        size = max(max(r.fitted[unit], r.held.get(unit, 0.0)) for r in subject.rows)
        factor, shown = display(unit, size)
        return Bars(
            tuple(r.name for r in subject.rows),
            tuple(r.weight for r in subject.rows),
            tuple(r.fitted[unit] / factor for r in subject.rows),
            tuple(r.held[unit] / factor if unit in r.held else None for r in subject.rows),
            shown,
        )

    def caption(self, data: Bars) -> str:
        """How to read it."""
        held = ", orange of those held out" if any(h is not None for h in data.held) else ""
        return (
            "Left: Akaike weight, the share of support among these models only. "
            f"Right: root mean square error, blue of the fitted recordings{held}."
        )

    def draw(self, data: Bars) -> Figure:
        """Horizontal bars, best on top."""
        p = len(data.names)
        figure = Figure(figsize=(10, max(2.2, 0.42 * p + 1.2)), layout="constrained", facecolor=PAPER)
        left, right = figure.subplots(1, 2, sharey=True)
        rows = list(range(p))
        for ax in (left, right):
            tidy(ax)
        left.barh(rows, data.weight, color=MODEL, height=0.55)
        for row, weight in zip(rows, data.weight, strict=True):
            left.text(
                weight, row, f" {weight:.3f}" if weight >= 5e-4 else " < 0.001", va="center", fontsize=8, color=INK
            )
        left.set_xlim(0, 1.15)
        left.set_yticks(rows, data.names)
        left.invert_yaxis()
        left.set_xlabel("Akaike weight")
        aside = 0.17 if any(h is not None for h in data.held) else 0.0
        right.barh([r - aside for r in rows], data.fitted, height=0.3 if aside else 0.55, color=MODEL, label="fitted")
        if aside:
            right.barh(
                [r + aside for r in rows], [h or 0.0 for h in data.held], height=0.3, color=HELD, label="held out"
            )
        figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=2, frameon=False, fontsize=8)
        right.set_xlabel(f"root mean square error ({data.unit})")
        return figure


def verdict(found: Comparison) -> str:
    """Which model to take, and what that rests on, in two or three sentences."""
    best, rest = found.best, found.rows[1:]
    text = f"Of {len(found.rows)} models of {found.sample} the data support {best.name} most"
    text += f" (Akaike weight {best.weight:.2f})"
    near = [r for r in rest if -2 * (_log(r.weight) - _log(best.weight)) < TELLS]
    if near:
        text += f", but {', '.join(r.name for r in near)} about as well (differences in AIC below {TELLS:g})"
    text += ". "
    if found.inflation > 1.3:
        text += (
            f"None of them reaches the noise (least chi-square per degree of freedom {found.inflation:.3g}), so the "
            "weights are those of the quasi-AIC, in which a misfit that all share counts for nothing. "
        )
    held = {r.name: next(iter(r.held.values())) for r in found.rows if r.held}
    if held:
        who = min(held, key=held.get)
        factor, unit = display(next(iter(best.held)), held[who])
        text += f"What was held out is predicted best by {who} (RMSE {held[who] / factor:.3g} {unit})"
        text += "." if who == best.name else f"; {best.name} reaches {held[best.name] / factor:.3g} {unit}."
    else:
        text += "Nothing was held out: which of them predicts is not known (--holdout NAME)."
    return text.strip()


def _log(x: float) -> float:
    return math.log(max(x, 1e-300))


def lines(found: Comparison) -> list[dict[str, str]]:
    """Rows of the table, as text."""
    best = min(r.aic for r in found.rows), min(r.bic for r in found.rows)

    def rmse(errors) -> str:
        parts = []
        for unit, value in errors.items():
            factor, shown = display(unit, value)
            parts.append(f"{value / factor:.4g} {shown}")
        return ", ".join(parts)

    return [
        {
            "name": r.name,
            "free": str(r.free),
            "aic": f"{r.aic - best[0]:.1f}",
            "bic": f"{r.bic - best[1]:.1f}",
            "weight": f"{r.weight:.3f}",
            "chi2": "" if r.chi2_per_dof is None else f"{r.chi2_per_dof:.4g}",
            "fitted": rmse(r.fitted),
            "held": rmse(r.held),
            "note": _note(r),
        }
        for r in found.rows
    ]


def numbers(found: Comparison) -> list[dict[str, float | str | None]]:
    """Rows of the table as numbers, SI; the criteria as differences from the least."""
    best = min(r.aic for r in found.rows), min(r.bic for r in found.rows)
    return [
        {
            "model": r.name,
            "free parameters": r.free,
            "samples": r.n,
            "AIC - least AIC": r.aic - best[0],
            "BIC - least BIC": r.bic - best[1],
            "Akaike weight": r.weight,
            "chi-square per degree of freedom": r.chi2_per_dof,
        }
        | {f"RMSE fitted ({unit})": error for unit, error in r.fitted.items()}
        | {f"RMSE held out ({unit})": error for unit, error in r.held.items()}
        | {
            "converged": int(r.status == Ending.CONVERGED),
            "parameters at a bound": len(_bounds(r)),
            "open directions": len(r.warnings) - len(_bounds(r)),
        }
        for r in found.rows
    ]


def _bounds(row: Row) -> list[str]:
    return [w for w in row.warnings if w.endswith(" bound")]


def _note(row: Row) -> str:
    """What to know of a fit before taking it, briefly: its own page says it all."""
    said = [] if row.status == Ending.CONVERGED else [f"not converged: {row.status}."]
    bounds = _bounds(row)
    others = [w for w in row.warnings if w not in bounds]
    said += [f"{', '.join(bounds)}."] * bool(bounds) + others[:NOTED]
    if len(others) > NOTED:
        said.append(f"{len(others) - NOTED} more directions are open: too many parameters for these data.")
    return " ".join(said)

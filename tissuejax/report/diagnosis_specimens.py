"""Many specimens at a glance: which effects were found in which, and how far the misfit fell."""

from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.specimens import Specimens
from tissuejax.report.plot import FAINT, HELD, INK, MODEL, Plot, grid

ABREAST = 5  # entries of the key
MARKS = {"found-in-part": "+", "ambiguous": "?", "unexplained": "x", "nothing-missing": "–"}
ERRORS = {  # colour, and what the key says
    "before_fitted": (FAINT, "base model, fitted"),
    "after_fitted": (MODEL, "with the effects, fitted"),
    "after_held_out": (HELD, "with the effects, held out"),
}


def attempted(record: dict) -> list[str]:
    """Effects of the best attempt of a specimen that stayed unexplained, whatever their forms."""
    return list(dict.fromkeys(key.split("/")[0] for key in record["best_attempt"]))


class DiagnosisSpecimens(Plot):
    """Left: effects by specimen, the first one found darkest. Right: misfit before and after, over the peak."""

    name: ClassVar[str] = "specimens"
    subject: ClassVar[type] = Specimens
    order: ClassVar[int] = 10

    def prepare(self, subject: Specimens) -> dict | None:
        """Names, effects (most frequent first), the rank of each effect in each specimen, and errors."""
        names, effects = list(subject.records), list(subject.counts)
        if not names:
            return None
        effects_of = {n: r["effects"] or attempted(r) for n, r in subject.records.items()}
        effects += [e for e in dict.fromkeys(e for t in effects_of.values() for e in t) if e not in effects]
        rank = np.full((len(names), max(len(effects), 1)), np.nan)
        for i, name in enumerate(names):
            for order, effect in enumerate(effects_of[name]):
                rank[i, effects.index(effect)] = order
        errors = [subject.records[n]["rmse_over_peak"] for n in names]
        return {
            "names": names,
            "groups": [subject.groups.get(n, "") for n in names],
            "effects": effects,
            "rank": rank,
            "verdicts": [subject.records[n]["verdict"] for n in names],
            **{
                f"{when}_{role}": np.array([e[when].get(role, np.nan) for e in errors])
                for when in ("before", "after")
                for role in ("fitted", "held_out")
            },
        }

    def caption(self, data: dict) -> str:
        """What was found in how many."""
        n = len(data["names"])
        named = np.array([Kind(v).speaks for v in data["verdicts"]])
        counts = [int(np.sum(np.isfinite(data["rank"][named, j]))) for j in range(len(data["effects"]))]
        found = [f"{e} in {k}" for e, k in zip(data["effects"], counts, strict=True) if k]
        return (
            f"{n} specimens, each diagnosed for itself: {', '.join(found) or 'no effect named'} of {n}. Left: effects "
            "found, the first one darkest; + in part, ? ambiguous, x unexplained (open: the best attempt). Right: RMSE "
            "over peak, base model (grey), with the effects (blue fitted, orange held out)."
        )

    def draw(self, data: dict) -> Figure:
        """Two panels sharing the specimens."""
        n = len(data["names"])
        key = self.key(data)
        rows = -(-len(key) // ABREAST)
        figure, (left, right) = grid(2, columns=2, height=max(2.4, 0.6 + 0.2 * n) + 0.2 * rows)
        y = np.arange(n)[::-1]
        for j in range(len(data["effects"])):
            for i in range(n):
                order = data["rank"][i, j]
                if np.isfinite(order):
                    inside = "none" if data["verdicts"][i] == "unexplained" else MODEL
                    shade = max(1 - 0.3 * order, 0.25)
                    left.plot(j, y[i], "s", color=MODEL, markerfacecolor=inside, alpha=shade, markersize=7)
        for i, kind in enumerate(data["verdicts"]):
            left.text(len(data["effects"]) - 0.4, y[i], MARKS.get(kind, ""), color=INK, fontsize=8, va="center")
        left.set_xticks(range(len(data["effects"])), data["effects"], rotation=35, ha="right")
        left.set_xlim(-0.7, max(len(data["effects"]), 1) - 0.1)
        left.set_yticks(y, data["names"], fontsize=7)
        for errors, (colour, _) in ERRORS.items():
            right.plot(100 * data[errors], y, "o", color=colour, markersize=4)
        right.set_xscale("log")
        low, high = right.get_xlim()
        ticks = [v for v in (0.05, 0.1, 0.2, 0.3, 0.5, 1, 2, 3, 5, 7, 10, 20, 30, 50) if low <= v <= high]
        right.set_xticks(ticks, [f"{v:g}" for v in ticks])
        right.minorticks_off()
        for ax in (left, right):
            ax.set_ylim(-0.7, n - 0.3)
        right.set_yticks(y, [])
        right.set_xlabel("RMSE over peak, %")
        figure.legend(handles=key, loc="outside lower center", ncols=ABREAST, frameon=False, fontsize=8)
        return figure

    def key(self, data: dict) -> list[Line2D]:
        """One entry for each kind of mark that is drawn."""
        kinds, tried = set(data["verdicts"]), np.isfinite(data["rank"]).any(axis=1)
        open_ = np.array(data["verdicts"]) == "unexplained"
        shown = {  # label: whether it is drawn, marker, colour, face
            "effect found, the first darkest": ((tried & ~open_).any(), "s", MODEL, MODEL),
            "best attempt, unexplained": ((tried & open_).any(), "s", MODEL, "none"),
        }
        shown |= {k.replace("-", " "): (k in kinds, f"${m}$", INK, INK) for k, m in MARKS.items()}
        shown |= {label: (np.isfinite(data[e]).any(), "o", colour, colour) for e, (colour, label) in ERRORS.items()}
        return [
            Line2D([], [], linestyle="", marker=m, color=colour, markerfacecolor=face, markersize=5, label=label)
            for label, (drawn, m, colour, face) in shown.items()
            if drawn
        ]

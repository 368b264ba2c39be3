"""Several fits of one set of recordings side by side: likelihood, information criteria, held-out error.

Everything is computed from the records that fits write (`Fit.record()`, result.json), so that fits of last week can be
compared as well as those of this minute. Fits of different data are refused: their likelihoods say nothing to each
other. Source: Burnham and Anderson 2002, Model Selection and Multimodel Inference, secs. 2.2 to 2.9.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tissuejax.errors import InputError

if TYPE_CHECKING:
    from tissuejax.fitting.result import Fit

TELLS = 2.0  # difference of AIC from which one model is called better supported (Burnham and Anderson, sec. 2.6)


@dataclass(frozen=True)
class Row:
    """One fit in the table.

    Attributes:
        name: energy and effects.
        free: number of estimated parameters, noise levels not counted.
        n: samples.
        deviance: -2 ln L with unknown noise levels at their own best values.
        aic, aicc, bic: information criteria, lower is better; aicc is infinite with as many parameters as samples.
        weight: Akaike weight among the rows, from the criterion corrected for misfit (`Comparison.inflation`).
        chi2_per_dof: None where the noise was not recorded.
        held: root mean square error of what was held out, by unit, SI; empty if nothing was.
        fitted: the same of what was fitted.
        status: "converged" or why not.
        warnings: sentences on parameters at a bound or not identified.
    """

    name: str
    free: int
    n: int
    deviance: float
    aic: float
    aicc: float
    bic: float
    weight: float
    chi2_per_dof: float | None
    held: Mapping[str, float]
    fitted: Mapping[str, float]
    status: str
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Comparison:
    """The rows, best first, and what they come from.

    Attributes:
        sample: its name.
        rows: by falling weight.
        inflation: c-hat >= 1, the least chi-square per degree of freedom of all rows; the weights are those of
            deviance / c-hat + 2 k (quasi-AIC), so that a misfit that every model shares decides nothing.
        failed: fits that gave no answer, and why.
        fits: the fits themselves where they are at hand.
    """

    sample: str
    rows: tuple[Row, ...]
    inflation: float
    failed: Mapping[str, str] = field(default_factory=dict)
    fits: Mapping[str, "Fit"] = field(default_factory=dict)

    @property
    def best(self) -> Row:
        """The row of the largest weight."""
        return self.rows[0]

    def record(self) -> dict:
        """For result.json."""
        return {
            "sample": self.sample,
            "inflation": self.inflation,
            "rows": [vars(row) for row in self.rows],
            "failed": dict(self.failed),
        }


def name_of(record: Mapping) -> str:
    """What was fitted, e.g. "demiray + viscoelasticity + slack"."""
    return " + ".join([record["energy"]["name"], *record["effects"]])


def compare(
    records: Mapping[str, Mapping], failed: Mapping[str, str] | None = None, fits: Mapping[str, "Fit"] | None = None
) -> Comparison:
    """The comparison of fit records by name.

    Raises:
        InputError: none at all, a record without a fingerprint of its data, or records of different data.
    """
    if not records:
        raise InputError(
            "nothing to compare: no fit gave an answer" + "".join(f"; {t}" for t in (failed or {}).values())
        )
    marks = {name: record.get("data") for name, record in records.items()}
    first, mark = next(iter(marks.items()))
    for name, other in marks.items():
        if other is None:
            raise InputError(f"{name}: its result does not say which data it was fitted to; fit it again")
        if other != mark:
            raise InputError(
                f"{first} and {name} were fitted to different data (recordings, channels or recorded noise differ), so "
                "their likelihoods can't be compared: fit both to the same recordings, with the same --only, "
                "--holdout, --channel and --weights"
            )
    chi2 = [r["chi2_per_dof"] for r in records.values() if not _unknown(r) and r["chi2_per_dof"] is not None]
    inflation = max(1.0, min(chi2, default=1.0))
    found = {name: _row(name, record) for name, record in records.items()}
    quasi = {name: row["deviance"] / inflation + 2 * row["free"] for name, row in found.items()}
    least = min(quasi.values())
    share = {name: math.exp(-0.5 * (value - least)) for name, value in quasi.items()}
    total = sum(share.values())
    rows = [Row(**row, weight=share[name] / total) for name, row in found.items()]
    rows.sort(key=lambda row: (quasi[row.name], row.name))
    sample = next(iter(records.values()))["sample"]
    return Comparison(sample, tuple(rows), inflation, dict(failed or {}), dict(fits or {}))


def _unknown(record: Mapping) -> dict[str, list[str]]:
    """Channels whose noise was not recorded, by unit: those of a unit share one level."""
    groups: dict[str, list[str]] = {}
    for key, level in record["noise"].items():
        if level["estimated"] and key in record["channels"]:
            groups.setdefault(record["channels"][key]["unit"], []).append(key)
    return groups


def _row(name: str, record: Mapping) -> dict:
    """All of a `Row` but its weight.

    -2 ln L = sum over channels of n ln(2 pi s^2) + RSS / s^2; an unknown level enters as s f with the f of largest
    likelihood, f^2 = (1/n) sum RSS / s^2 over the channels that share it, and counts as one parameter.
    """
    channels, noise, groups = record["channels"], record["noise"], _unknown(record)
    free = sum(bool(p["free"]) for p in record["parameters"].values())
    n = sum(s["n"] for s in channels.values())

    def square(key: str) -> float:
        return channels[key]["n"] * (channels[key]["rmse"] / noise[key]["std"]) ** 2

    factor = dict.fromkeys(channels, 1.0)
    for members in groups.values():
        level = sum(map(square, members)) / max(1, sum(channels[k]["n"] for k in members))
        factor |= dict.fromkeys(members, max(level, 1e-300))
    deviance = sum(
        channels[key]["n"] * math.log(2 * math.pi * noise[key]["std"] ** 2 * f) + square(key) / f
        for key, f in factor.items()
    )
    k = free + len(groups)
    small = 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else math.inf
    return {
        "name": name,
        "free": free,
        "n": n,
        "deviance": deviance,
        "aic": deviance + 2 * k,
        "aicc": deviance + 2 * k + small,
        "bic": deviance + k * math.log(n),
        "chi2_per_dof": None if groups else record["chi2_per_dof"],
        "held": _rmse(record["holdout"]),
        "fitted": _rmse(channels),
        "status": record["status"],
        "warnings": tuple(
            [f"{path} at its {p['at_bound']} bound" for path, p in record["parameters"].items() if p["at_bound"]]
            + list(record["not_identified"])
        ),
    }


def _rmse(scores: Mapping[str, Mapping]) -> dict[str, float]:
    """Root mean square over all samples of a unit."""
    by_unit: dict[str, list[Mapping]] = {}
    for s in scores.values():
        by_unit.setdefault(s["unit"], []).append(s)
    return {
        unit: math.sqrt(sum(s["n"] * s["rmse"] ** 2 for s in of) / max(1, sum(s["n"] for s in of)))
        for unit, of in by_unit.items()
    }

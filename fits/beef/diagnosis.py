"""Beef, 148 ramp-and-hold indentations: what does a hyperelastic law lack, in how many, and does it carry over?

Ten tests are diagnosed one by one: on each of five days the first of one muscle and the last of the other. The
relaxation of the first five, its median, is then carried to the 143 others, which bring only two moduli of their own.

tissuejax study fits/beef
"""

from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.specimens import Specimens, brief
from tissuejax.diagnosis.transfer import transfer
from tissuejax.energies.catalogue import energy
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read_all
from tissuejax.report.diagnosis_page import write_diagnosis
from tissuejax.report.page import png, write_figures
from tissuejax.report.plot import FAINT, HELD, INK, grid
from tissuejax.storage import write_bytes, write_json

ENERGY = "reduced-polynomial-2"
DAYS, MEATS = ("230327", "230331", "230403", "230407", "230411"), ("RDG", "FF")
TIMES = (0.05, 0.5, 6.0)  # s, between those found test by test
TAUS = {f"effects.viscoelasticity.tau{i + 1}": t for i, t in enumerate(TIMES)}
SHARES = tuple(f"effects.viscoelasticity.g{i + 1}" for i in range(len(TIMES)))
EFFORT = Effort(most=2)
SHOWN = 1  # of the first five


def chosen(names: list[str], turn: int) -> list[str]:
    """One test a day, sirloin and eye of round by turns: the day's first of one (turn 0), its last of the other (1)."""
    groups = [[n for n in names if n.startswith(f"{day}_{MEATS[(i + turn) % 2]}")] for i, day in enumerate(DAYS)]
    return [g[-turn] for g in groups]


def carried(samples: dict, discovery: list[str]) -> tuple[dict, dict]:
    """Median shares of the discovery tests, and every other test with them."""
    law, own, others = energy(ENERGY), {}, {}
    with for_terminal().stage("carrying relaxation over", len(samples)) as stage:
        for name in discovery:
            own[name] = transfer(samples[name], law, ["viscoelasticity"], TAUS, SHARES)
            stage.advance(note=name)
        median = {p: float(np.median([t.base[p] for t in own.values()])) for p in SHARES}
        for name, sample in samples.items():
            if name not in own:
                others[name] = transfer(sample, law, ["viscoelasticity"], {**TAUS, **median})
                stage.advance(note=name)
    shared = {"times_s": list(TIMES), "shares": list(median.values())}
    shared["shares_each"] = {n: [t.base[p] for p in SHARES] for n, t in own.items()}
    return shared, others


def picture(others: dict, days: tuple[str, ...]) -> bytes:
    """Error over peak of every held-out test, before and with the relaxation of others."""
    figure, (ax,) = grid(1, columns=1, height=3.4)
    order = sorted(others, key=lambda n: (n[:6], others[n].before / others[n].peak))
    for values, colour, name in (
        ([100 * others[n].before / others[n].peak for n in order], FAINT, "hyperelastic law alone"),
        ([100 * others[n].carried / others[n].peak for n in order], HELD, "with the relaxation of five other tests"),
    ):
        ax.plot(values, ".", color=colour, label=name)
    for day in days[1:]:
        ax.axvline(sum(n[:6] < day for n in order) - 0.5, color=INK, linewidth=0.5)
    ax.set(yscale="log", xlabel=f"{len(order)} held-out tests, by day", ylabel="RMSE over peak force, %")
    ax.set_yticks([0.5, 1, 2, 5, 10, 20], ["0.5", "1", "2", "5", "10", "20"])
    ax.legend(frameon=False, fontsize=9)
    return png(figure)


def main(folder: Path) -> str:
    """Diagnose, carry over, write diagnosis.json and figures; returns the answer in a sentence."""
    samples = read_all(folder / "relaxation.toml")
    discovery, later = chosen(list(samples), 0), chosen(list(samples), 1)
    records = {}
    for name in (*discovery, *later):
        found = tj.diagnose(samples[name], ENERGY, effort=EFFORT, progress=for_terminal())
        records[name] = brief(found)
        if name == discovery[SHOWN]:
            write_diagnosis(found, folder / "figures" / "diagnosis", remainders=False)
    many = Specimens(records)
    shared, others = carried(samples, discovery)
    write_figures(many, folder / "figures")
    write_bytes(folder / "figures" / "carried.png", picture(others, DAYS))
    before, after = (np.array([getattr(t, k) / t.peak for t in others.values()]) for k in ("before", "carried"))
    summary = {
        "tests": len(others),
        "rmse_over_peak_before": quartiles(before),
        "rmse_over_peak_carried": quartiles(after),
        "explained": quartiles(np.array([t.explained for t in others.values()])),
        "better": int(np.sum(after < before)),
        "shared": shared,
    }
    out = {"diagnosed": many.as_dict(), "carried": summary, "held_out": {n: t.as_dict() for n, t in others.items()}}
    write_json(folder / "diagnosis.json", out)
    n = sum("viscoelasticity" in r["effects"] for r in records.values())
    first = many.first().get("viscoelasticity", 0)
    return (
        f"viscoelasticity found in {n} of {len(records)} tests, first in {first}; carried to {len(others)} others the "
        f"median error over peak falls from {np.median(before):.1%} to {np.median(after):.1%}"
    )


def quartiles(values: np.ndarray) -> list[float]:
    """Smallest, quartiles, largest."""
    return [float(q) for q in np.quantile(values, [0, 0.25, 0.5, 0.75, 1])]


if __name__ == "__main__":
    print(main(Path(__file__).parent))

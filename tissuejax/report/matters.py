"""How many answers change where one number of the judgement is halved or doubled: a row for each number."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from tissuejax.report.plot import INK, PAPER, SERIES, tidy


def matters_figure(rows: Sequence[Mapping], column: str) -> Figure:
    """Numbers down, the one that changes most at the top; halved to the left, doubled to the right.

    Args:
        rows: with "number", "factor" (below or above one) and the count in `column`.
    """
    most = {n: max(r[column] for r in rows if r["number"] == n) for n in dict.fromkeys(r["number"] for r in rows)}
    names = sorted(most, key=lambda n: most[n])
    figure = Figure(figsize=(7, 1.0 + 0.2 * len(names)), layout="constrained", facecolor=PAPER)
    ax = figure.subplots()
    tidy(ax)
    for r in rows:
        ax.barh(names.index(r["number"]), r[column] * (1 if r["factor"] > 1 else -1), 0.7, color=SERIES[0])
    reach = max(max(most.values(), default=0), 1)
    ax.set_xlim(-1.1 * reach, 1.1 * reach)
    ax.set_xticks(ticks := sorted({-reach, 0, reach}), [str(abs(t)) for t in ticks])
    ax.axvline(0.0, color=INK, linewidth=0.8)
    ax.set_yticks(range(len(names)), names, fontsize=7, color=INK)
    ax.set_xlabel(f"{column}: halved (left), doubled (right)")
    return figure

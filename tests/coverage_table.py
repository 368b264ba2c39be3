"""Files of which the suite runs least, and all of them together: `python tests/coverage_table.py whole.json more.json`.

Each part of `make test` writes what it ran when it ends; a line counts as run if any part ran it.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import slipcover

SHOWN = 15


def table(parts: Sequence[Path], shown: int = SHOWN) -> str:
    """Lines, lines that were not run and the share that was, of the files with the smallest share, then of all."""
    whole, *more = (json.loads(part.read_text()) for part in parts)
    for other in more:
        slipcover.merge_coverage(whole, other)
    rows = [(len(f["executed_lines"]), len(f["missing_lines"]), name) for name, f in whole["files"].items()]
    rows = sorted((run / max(run + missed, 1), run + missed, missed, name) for run, missed, name in rows)
    lines, missed = (sum(row[i] for row in rows) for i in (1, 2))
    rows = [*rows[:shown], (1 - missed / max(lines, 1), lines, missed, "TOTAL")]
    return "\n".join(
        f"{name:60s} {lines:6d} lines {missed:5d} missed {100 * share:4.0f} %" for share, lines, missed, name in rows
    )


if __name__ == "__main__":
    print(table([Path(part) for part in sys.argv[1:]]))

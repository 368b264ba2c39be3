"""The example table `cutting/cut.csv`: the three strokes of `cut.h5` as a lab would write them down.

python data/make_cut_table.py
"""

import csv
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).parent


def main() -> None:
    """Write `cut.csv`."""
    with h5py.File(HERE / "cut.h5") as file, open(HERE / "cutting" / "cut.csv", "w", newline="") as out:
        table = csv.writer(out, lineterminator="\n")
        table.writerow(["stroke", "t_s", "x_mm", "depth_mm", "Fx_N", "Fz_N"])
        for name in ("there-back-again", "fast", "shallow"):
            r = file["recordings"][name]
            rows = np.column_stack([r["blade/time"], r["blade/tip"][:, 0] * 1e3, np.asarray(r["depth"]) * 1e3,
                                    r["force/value"][:, 0], r["force/value"][:, 2]])  # fmt: skip
            table.writerows([name, *(f"{v:.8g}" for v in row)] for row in rows)


if __name__ == "__main__":
    main()

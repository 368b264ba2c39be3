"""Writes data/lab/tension.csv: the demo's relaxing block in tension, as the table that a German test machine exports.

    python data/make_lab.py FOLDER

A header with the specimen, a row of units, semicolons, decimal commas, latin-1. The numbers are those of
`demo/relaxing.h5` (closed forms in plain numpy, see `make_demo.py`): C10 620 Pa, C20 540 Pa, 35 % of the stress
relaxing with 2.5 s, noise 8 Pa; here on a specimen of 40 mm gauge length, 20 x 10 mm, so that the cell reads
millinewtons.
"""

import sys
from pathlib import Path

import h5py
import numpy as np

LENGTH, WIDTH, THICKNESS = 40.0, 20.0, 10.0  # mm
HEAD = f"""Prüfprotokoll;Zugversuch
Probe;Gewebe 7
Messlänge;{LENGTH:.1f};mm
Breite;{WIDTH:.1f};mm
Dicke;{THICKNESS:.1f};mm

Zeit;Weg;Kraft
s;mm;mN
""".replace(".", ",")


def main(out: Path) -> None:
    """Write the table."""
    with h5py.File(Path(__file__).parent / "demo" / "relaxing.h5") as file:
        group = file["recordings/tension"]
        time, stretch = group["time"][()], group["stretch"][()]
        stress = group["nominal_stress"][()]
    columns = np.stack([time, LENGTH * (stretch - 1), stress * WIDTH * THICKNESS * 1e-3], 1)
    rows = "".join(";".join(f"{v:.4f}".replace(".", ",") for v in row) + "\n" for row in columns)
    out.mkdir(parents=True, exist_ok=True)
    (out / "tension.csv").write_bytes((HEAD + rows).encode("latin-1"))


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""TRC ("track row column"): motion capture as tab-separated text (OpenSim, Motion Analysis), units in its header."""

from pathlib import Path
from typing import ClassVar

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings.delimited import text_lines
from tissuejax.recordings.exports.tracked import MarkerExport, Tracked


class Trc(MarkerExport):
    """Header lines (rates, counts, unit, marker names, X1 Y1 Z1 ...), then frame, time and three cells a marker."""

    name: ClassVar[str] = "trc"
    program: ClassVar[str] = "TRC motion capture"
    basis: ClassVar[str] = "its public description"

    def recognises(self, path: Path, head: str) -> bool:
        """By its first word."""
        return head.startswith("PathFileType")

    def read(self, path: Path) -> Tracked:
        """Markers in the order of the file; an empty cell is a lost marker."""
        lines = text_lines(path)
        if len(lines) < 6:
            raise InputError(f"{path}: found {len(lines)} lines, expected a TRC file's five header lines and frames")
        header = dict(zip(lines[1].split("\t"), lines[2].split("\t")))
        names = [n.strip() for n in lines[3].split("\t")[2:] if n.strip()]
        rows, numbers = [], []
        for number, line in enumerate(lines[4:], start=5):
            cells = line.rstrip("\r\n").split("\t")
            if cells[0].strip().isdigit() and len(cells) > 2:
                rows.append(cells)
                numbers.append(number)
        if not rows or not names:
            raise InputError(f"{path}: found no frames of markers, expected rows of frame, time and coordinates")
        width = 2 + 3 * len(names)
        data = np.full((len(rows), width), np.nan)
        for i, (cells, number) in enumerate(zip(rows, numbers)):
            if len(cells) < width - 3 * len(names) + 1 or len([c for c in cells if c.strip()]) > width:
                raise InputError(f"{path}: line {number}: found {len(cells)} cells, expected {width}")
            for j, cell in enumerate(cells[:width]):
                if cell.strip():
                    try:
                        data[i, j] = float(cell)
                    except ValueError:
                        raise InputError(f"{path}: line {number}: found {cell!r}, expected a number") from None
        position = data[:, 2:].reshape(len(rows), len(names), 3)
        return Tracked(data[:, 1], position, tuple(names), header.get("Units", "").strip())

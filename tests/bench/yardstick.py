"""What this processor can do, measured in the same run as our own figures, which stand beside it.

`yardstick.c` (ours) is compiled twice where a C compiler is. `measure()` gives the bandwidth of a triad in a core's
cache and in memory (GB/s) and the rate of fused multiply-adds (1e9/s), `Hand` is the hand-written hex step. CPU time of
this thread, the best of several. Where there is no compiler, `library` and `measure` give None. Every benchmark writes
all of it beside its figures (`bench_step.machine`); `bench_yardstick.py` takes our step and the hand-written one in
turns and says how far the two displacements are apart.
"""

import ctypes
import functools
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from tissuejax.elements.hex8 import Hex8
from tissuejax.tled import internal
from tissuejax.tled.lanes.library import WIDE

SOURCE = Path(__file__).with_name("yardstick.c")
FLAGS = ["-O3", "-march=native", "-ffast-math", "-fopenmp-simd", "-fno-math-errno", "-shared", "-fPIC", "-std=gnu11"]
FLAGS += WIDE  # whole registers, as our own loop has them
KINDS = {"float32": ("float", np.float32, ctypes.c_float), "float64": ("double", np.float64, ctypes.c_double)}
LAW = ("C10", "C20", "C30", "C40")


@functools.cache
def library(precision: str) -> ctypes.CDLL | None:
    """The compiled yardstick, or None where no compiler is."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    name, _, real = KINDS[precision]
    made = Path(tempfile.mkdtemp()) / "yardstick.so"
    extra = ["-DDOUBLE"] if precision == "float64" else []
    subprocess.run([compiler, *FLAGS, f"-DREAL={name}", *extra, str(SOURCE), "-o", str(made), "-lm"], check=True)
    loaded = ctypes.CDLL(str(made))
    loaded.fused.restype = real
    return loaded


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def seconds(call, rounds: int = 5) -> float:
    """CPU time of the best of so many calls, s."""
    best = float("inf")
    for _ in range(rounds):
        start = time.process_time()
        call()
        best = min(best, time.process_time() - start)
    return best


class Hand:
    """A scene of straight hexes, a reduced polynomial of order 4 or less and gravity, for the hand-written step."""

    def __init__(self, scene: Any, precision: str):
        if not isinstance(scene.body.element, Hex8) or not scene.body.element.straight:
            raise ValueError("the hand-written step is for parallelepipeds")
        self.library, (_, real, self.real) = library(precision), KINDS[precision]
        lanes, count = 64 // real().itemsize, len(scene.body.cells)
        mesh = internal.mesh(scene)
        cells, reference = np.asarray(scene.body.cells), mesh.reference
        rows = np.concatenate(
            [np.asarray(reference.gradient).reshape(9, -1), np.asarray(reference.hourglass).reshape(12, -1),
             np.asarray(reference.stiffening)[None], np.asarray(reference.volume)[None]]
        )[:, :count]  # fmt: skip
        groups = -(-count // lanes)
        spare = groups * lanes - count
        cells = np.concatenate([cells, np.repeat(cells[-1:], spare, 0)])
        rows = np.concatenate([rows, np.repeat(rows[:, -1:], spare, 1)], 1)
        rows[21:, count:] = 0.0  # no stiffness and no volume: they add nothing
        self.cells = np.ascontiguousarray(cells.reshape(groups, lanes, 8).transpose(0, 2, 1), np.int32)
        self.rows = _aligned(rows.reshape(23, groups, lanes).transpose(1, 0, 2), real)
        values = scene.tissue.energy_values
        shear = float(scene.tissue.energy.initial_shear_modulus(values))
        constants = [float(values.get(name, 0.0)) for name in LAW]
        bulk = float(scene.tissue.volumetric_values["K"])
        self.law = np.array([*constants, bulk, float(scene.settings.hourglass) * shear], real)
        self.gravity = np.array([*np.asarray(scene.gravity), 0.0], real)
        inverse = 1 / np.asarray(mesh.mass, float)
        inverse[np.asarray(scene.body.fixed)] = 0.0
        self.inverse = np.ascontiguousarray(inverse, real)
        self.nodes, self.groups, self.count = len(inverse), groups, count
        self.step, self.damping = float(scene.clock.step), float(scene.settings.mass_damping)
        self.rest()

    def rest(self) -> None:
        """Back to the start: half a step behind, as ours begins."""
        zeros = np.zeros((self.nodes, 4))
        self.u, self.f = _aligned(zeros, self.inverse.dtype), _aligned(zeros, self.inverse.dtype)
        back = -0.5 * self.step * self.gravity * (self.inverse[:, None] > 0)
        self.v = _aligned(back, self.inverse.dtype)

    def run(self, steps: int) -> None:
        """So many steps."""
        self.library.run(
            _at(self.u), _at(self.v), _at(self.f), _at(self.inverse), _at(self.cells), _at(self.rows), _at(self.law),
            _at(self.gravity), self.real(self.step), self.real(self.damping), ctypes.c_int64(self.nodes),
            ctypes.c_int64(self.groups), ctypes.c_int64(steps),
        )  # fmt: skip


def _aligned(a: np.ndarray, real) -> np.ndarray:
    raw = np.zeros(a.size * np.dtype(real).itemsize + 64, np.uint8)
    begin = -raw.ctypes.data % 64
    out = raw[begin : begin + a.size * np.dtype(real).itemsize].view(real).reshape(a.shape)
    out[...] = a
    return out


def measure() -> dict | None:
    """Bandwidth and multiply-adds of one thread, by precision; None without a compiler."""
    figures = {}
    for precision, (_, real, _) in KINDS.items():
        made = library(precision)
        if made is None:
            return None
        size, told = np.dtype(real).itemsize, {}
        for name, total in (("cache", 96 * 1024), ("memory", 192 * 2**20)):
            n = total // 3 // size
            a, b, c = (np.ones(n, real) for _ in range(3))
            times = max(1, 2**30 // total)
            call = lambda: made.triad(_at(a), _at(b), _at(c), ctypes.c_int64(n), ctypes.c_int64(times))  # noqa: B023, E731
            told[f"triad in {name}, GB/s"] = round(3 * n * size * times / seconds(call) / 1e9, 1)
        times = 2_000_000
        rate = 12 * (64 // size) * times / seconds(lambda: made.fused(ctypes.c_int64(times))) / 1e9  # noqa: B023
        figures[precision] = told | {"multiply-adds, 1e9/s": round(rate, 1)}
    return figures

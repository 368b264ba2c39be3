"""The haptic loop in its own process, and how late it was.

Lateness is against times that lie 1 / rate apart from the start, on the monotonic clock; every sample is kept, and
after a miss nothing is set back. Kernel, policy and load are reported beside the numbers, since these decide.
"""

import os
import platform
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.surrogate.live.compiler import compiled
from tissuejax.surrogate.live.flat import write
from tissuejax.surrogate.surrogate import Surrogate

LATE = 2.0  # periods: a step longer than that is felt


class Looped(NamedTuple):
    """What a loop did: `lateness` and `spent` (s) of every period, and the record of both."""

    lateness: Float[np.ndarray, " n"]
    spent: Float[np.ndarray, " n"]
    record: dict


def port_of(text: str) -> int:
    """The port in `udp:9870`; 0 for `none`: a hand that moves by itself.

    Raises:
        InputError: anything else.
    """
    if text == "none":
        return 0
    kind, _, number = text.partition(":")
    if kind != "udp" or not number.isdigit() or not 1024 <= int(number) <= 65535:
        raise InputError(f"--haptics {text}: wanted is udp:PORT with a port of 1024 to 65535, haply, or none")
    return int(number)


def start(
    surrogate: Surrogate, folder: Path, port: int, seconds: float, rate: float, most: float, slew: float
) -> tuple[subprocess.Popen, tuple[int, int]]:
    """The loop's process, running: and whether it has real-time priority and locked memory.

    Raises:
        InputError: no compiler, or a port that is taken.
    """
    if not (seconds > 0 and rate > 0 and most > 0 and slew > 0):
        raise InputError("seconds, rate, force limit and slew limit of a haptic loop are positive")
    model = write(surrogate, folder / "model.tjf")
    command = [compiled("loop.c"), model, rate, seconds, port, most, slew, folder / "samples.bin"]
    process = subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    words = process.stdout.readline().split()
    if words[:1] != ["ready"]:
        fault = process.stderr.read().strip()
        process.wait()
        raise InputError(f"the haptic loop did not start: {fault}; give another port")
    return process, (int(words[1]), int(words[2]))


def loop(
    surrogate: Surrogate,
    port: int = 0,
    seconds: float = 10.0,
    rate: float = 1000.0,
    most: float = 3.0,
    slew: float = 300.0,
) -> Looped:
    """Run the loop to its end and say how it went."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        process, (real, locked) = start(surrogate, folder, port, seconds, rate, most, slew)
        out, fault = process.communicate()
        words = out.split()
        if process.returncode or words[:1] != ["done"]:
            raise InputError(f"the haptic loop ended with {process.returncode}: {fault.strip()}")
        samples = np.fromfile(folder / "samples.bin", "<f4").reshape(-1, 2).astype(float)
    late, spent = samples.T
    return Looped(late, spent, described(late, spent, rate, float(words[2]), bool(real), bool(locked)) | {
        "port": port, "answered": int(words[3]), "refused_packets": int(words[4]), "seconds": seconds,
        "force_limit_N": most, "slew_limit_N_per_s": slew,
    })  # fmt: skip


def described(late, spent, rate: float, took: float, real: bool, locked: bool) -> dict:
    """Rate and lateness in numbers; calls over elapsed time, not a count over itself."""
    starts = np.arange(len(late)) / rate + late
    steps = np.diff(starts)

    def spread(values):
        ms = 1e3 * np.asarray(values)
        return {
            "p50": float(np.quantile(ms, 0.5)), "p99": float(np.quantile(ms, 0.99)),
            "p99_9": float(np.quantile(ms, 0.999)), "max": float(ms.max()),
        }  # fmt: skip

    return {
        "rate_wanted_Hz": rate,
        "rate_Hz": len(late) / took,
        "periods": len(late),
        "lateness_ms": spread(late),
        "evaluation_us": {k: 1e3 * v for k, v in spread(spent).items()},
        "periods_over_two": float((steps > LATE / rate).mean()),
        "real_time": real,
        "policy": "SCHED_FIFO" if real else "SCHED_OTHER, not real time: no permission for real-time priority",
        "memory_locked": locked,
        "load": list(os.getloadavg()),
        "kernel": platform.release(),
        "cores": os.cpu_count(),
    }


def summary(record: dict) -> str:
    """The record in lines."""
    late, spent = record["lateness_ms"], record["evaluation_us"]
    return "\n".join([
        f"{record['periods']} periods at {record['rate_Hz']:.1f} Hz (wanted {record['rate_wanted_Hz']:.0f}); "
        + record['policy'],
        f"late     p50 {late['p50']:.3f}, p99 {late['p99']:.3f}, p99.9 {late['p99_9']:.3f}, max {late['max']:.3f} ms",
        f"force    p50 {spent['p50']:.2f}, p99 {spent['p99']:.2f} us",
        f"steps over two periods: {100 * record['periods_over_two']:.3f} %; load {record['load'][0]:.1f} on "
        f"{record['cores']} cores, kernel {record['kernel']}",
    ])  # fmt: skip

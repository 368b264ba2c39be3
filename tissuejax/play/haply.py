"""A client of the Haply service's websocket: position in, force out, each tick.

The service sends a JSON state about every device a thousand times a second and takes a JSON command back. This client
is Python, so its rate is measured and reported; forces pass the same limits as in the C loop.
"""

import asyncio
import json
import time
from collections.abc import Sequence

import numpy as np
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from tissuejax.errors import InputError
from tissuejax.play.guard import Guard

ADDRESS = "ws://localhost:10001"


def cursor(message: dict) -> tuple[str, np.ndarray] | None:
    """Device and cursor position, m, of a state message; None where it tells none."""
    for device in message.get("inverse3") or []:
        place = (device.get("state") or {}).get("cursor_position") or {}
        if {"x", "y", "z"} <= set(place):
            return str(device.get("device_id", "")), np.array([float(place[a]) for a in "xyz"])
    return None


def command(device: str, force: Sequence[float]) -> dict:
    """The message that sets a force, N."""
    newtons = {"vector": {a: float(f) for a, f in zip("xyz", force)}}
    return {"inverse3": [{"device_id": device, "commands": {"set_cursor_force": newtons}}]}


async def follow(asker, guard: Guard, centre: np.ndarray, seconds: float, address: str = ADDRESS) -> dict:
    """Answer the service for so long; returns counts and the spacing of the answers.

    Args:
        asker: anything with `tick(position, dt)`.
        centre: where the device's origin lies in the organ's frame, m.

    Raises:
        InputError: no service there.
    """
    steps, before, begin = [], None, time.perf_counter()
    device = ""
    try:
        async with connect(address, compression=None, open_timeout=3) as socket:
            try:
                while time.perf_counter() - begin < seconds:
                    text = await asyncio.wait_for(socket.recv(), 1.0)
                    now = time.perf_counter()
                    found = cursor(json.loads(text))
                    if found is None:
                        continue
                    device, place = found
                    dt = 1e-3 if before is None else now - before
                    before = now
                    steps.append(dt)
                    force = guard.safe(centre + place, 0.0, dt, asker.tick(centre + place, min(dt, 0.02)))
                    await socket.send(json.dumps(command(device, force)))
            finally:
                await socket.send(json.dumps(command(device, np.zeros(3))))  # never leave a force behind
    except (OSError, WebSocketException, TimeoutError) as fault:
        raise InputError(
            f"{address}: the Haply service does not answer ({fault}); start it, or use udp:PORT"
        ) from fault
    steps = 1e3 * np.array(steps[1:] or [np.nan])
    return {
        "answered": len(steps), "rate_Hz": float(1e3 / steps.mean()), "step_p99_ms": float(np.quantile(steps, 0.99)),
        "step_max_ms": float(steps.max()), "real_time": False,
    }  # fmt: skip

"""The loop process without hardware: its samples, its UDP, its words; and the Haply client against a stand-in."""

import asyncio
import json
import shutil
import socket
import struct
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from websockets.asyncio.server import serve

from tests.surrogate import made
from tissuejax.errors import InputError
from tissuejax.play import haply, haptics
from tissuejax.play.guard import Guard
from tissuejax.surrogate.live.ask import Asker

HAS_C = any(shutil.which(name) for name in ("cc", "gcc", "clang"))
needs_c = pytest.mark.skipif(not HAS_C, reason="no C compiler on this machine")


@needs_c
def test_every_period_is_kept_and_the_rate_is_calls_over_time():
    found = haptics.loop(made.formula(), seconds=0.5, rate=200.0)
    assert found.record["periods"] == len(found.lateness) == 100
    assert found.record["rate_Hz"] <= 200 / (1 - 0.02)
    assert (found.lateness >= -1e-5).all()  # never before its time
    assert found.record["policy"].startswith("SCHED_FIFO") == found.record["real_time"]


def test_lateness_is_told_of_samples_as_they_are():
    late = np.zeros(1000)
    late[500:503] = [5e-3, 4e-3, 3e-3]  # one stall: three periods start together, nothing is set back
    told = haptics.described(late, np.full(1000, 2e-6), 1000.0, 1.0, False, False)
    assert told["lateness_ms"]["max"] == pytest.approx(5.0)
    assert told["lateness_ms"]["p50"] == 0
    assert told["periods_over_two"] == pytest.approx(1 / 999)
    assert "not real time" in told["policy"]


@needs_c
def test_udp_answers_presses_and_falls_silent_when_the_hand_is_gone():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hand, tempfile.TemporaryDirectory() as folder:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        hand.settimeout(5)
        process, _ = haptics.start(made.formula(), Path(folder), port, 30.0, 500.0, 3.0, 1e4)
        try:
            with pytest.raises(InputError, match="taken"):
                haptics.start(made.formula(), Path(folder), port, 1.0, 500.0, 3.0, 1e4)
            at = [0.0, 0.0, float(made.height(0, 0)) - 3e-3]
            begun, answers = time.monotonic(), []
            while time.monotonic() - begun < 3 and (len(answers) < 100 or answers[-1][3] & 4 or answers[-1][2] < 0.05):
                hand.sendto(struct.pack("<IIdddd", len(answers) + 1, 0, 0.0, *at), ("127.0.0.1", port))
                sequence, flags, *force = struct.unpack("<IIddd", hand.recv(64))
                answers.append((sequence, force[0], force[2], flags))
            assert answers[-1][2] == pytest.approx(made.vertical(0, 0, 3e-3), rel=1e-3)
            hand.sendto(b"nonsense", ("127.0.0.1", port))
            time.sleep(0.1)  # nobody moves the probe: stale
            hand.settimeout(0.5)
            flags, force = 0, [1.0]
            while not flags & 8:
                _, flags, *force = struct.unpack("<IIddd", hand.recv(64))
            assert force == [0, 0, 0]
        finally:
            process.terminate()
            process.communicate()


@pytest.mark.parametrize("text", ["udp", "udp:80", "udp:99999", "tcp:9870", "serial"])
def test_a_bad_address_is_refused(text):
    with pytest.raises(InputError, match="wanted is udp:PORT"):
        haptics.port_of(text)


def test_the_haply_client_answers_each_state_and_ends_with_zero():
    got = []

    async def main():
        async def service(connection):
            for k in range(60):
                place = {"x": 0.0, "y": 0.0, "z": -2e-3 if k > 5 else 5e-3}
                await connection.send(
                    json.dumps({"inverse3": [{"device_id": "A", "state": {"cursor_position": place}}]})
                )
                got.append(json.loads(await connection.recv()))
            await connection.send(json.dumps({"inverse3": []}))
            async for text in connection:
                got.append(json.loads(text))

        async with serve(service, "127.0.0.1", 0) as server:
            port = server.sockets[0].getsockname()[1]
            centre = np.array([0.0, 0.0, float(made.height(0, 0))])
            guard = Guard(ramp=0.0)
            return await haply.follow(Asker(made.formula()), guard, centre, 1.0, f"ws://127.0.0.1:{port}")

    with pytest.raises(InputError, match="does not answer"):  # the stand-in stops telling states
        asyncio.run(main())
    forces = [g["inverse3"][0]["commands"]["set_cursor_force"]["vector"]["z"] for g in got]
    assert not any(forces[:6])
    assert forces[59] == pytest.approx(made.vertical(0, 0, 2e-3), rel=1e-3)
    assert forces[-1] == 0


def test_no_haply_service_is_said():
    with pytest.raises(InputError, match="Haply service does not answer"):
        asyncio.run(haply.follow(None, Guard(), np.zeros(3), 0.1, "ws://127.0.0.1:9"))

"""The page's server without a browser, and the exported page's text."""

import asyncio
import json

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from tests.surrogate import made
from tissuejax.errors import InputError
from tissuejax.play import page
from tissuejax.play.server import Server
from tissuejax.play.session import SurrogateSession
from tissuejax.surrogate.live.ask import Asker

START = [0.0, 0.0, float(made.height(0, 0)) + 1e-3]


def session():
    return SurrogateSession({"start": START, "title": "formula"}, Asker(made.formula(g=(0.2,), tau=(0.5,))))


def played(scenario, **options):
    """Run a coroutine against a server on a free port; returns its answer."""

    async def main():
        server = Server(session(), port=0, **options)
        ready = asyncio.Event()
        running = asyncio.create_task(server.run(lambda url: ready.set()))
        await ready.wait()
        try:
            async with asyncio.timeout(60):
                return await scenario(server, f"ws://127.0.0.1:{server.port}/")
        finally:
            server.stop.set()
            await running

    return asyncio.run(main())


async def frame(socket):
    """The next frame, as numbers."""
    while True:
        got = await socket.recv()
        if isinstance(got, bytes):
            return np.frombuffer(got, "<f4")


async def frames(socket, count):
    """So many messages."""
    return [await socket.recv() for _ in range(count)]


def down(depth):
    return json.dumps({"probe": [0.0, 0.0, float(made.height(0, 0)) - depth]})


def test_a_page_presses_and_reads_the_force():
    async def scenario(server, url):
        async with connect(url) as socket:
            assert json.loads(await socket.recv())["model"]["title"] == "formula"
            await socket.send(down(3e-3))
            for _ in range(60):
                got = await frame(socket)
                await socket.send(json.dumps({"drawn": float(got[0])}))
                if got[7] > 2.99e-3:
                    return got
        return None

    got = played(scenario)
    assert got is not None
    assert 0.75 * made.vertical(0, 0, 3e-3) < got[6] <= made.vertical(0, 0, 3e-3) * 1.001
    assert got[9] == 2  # two mode coefficients follow
    assert len(got) == 12


def test_two_pages_share_one_probe_and_one_may_reload():
    async def scenario(server, url):
        async with connect(url) as one, connect(url) as two:
            await one.recv(), await two.recv()
            await one.send(down(2e-3))
            for _ in range(40):
                seen = await frame(two)
                await two.send(json.dumps({"drawn": 1}))
                if seen[7] > 1.9e-3:
                    break
        async with connect(url) as again:  # a reload finds the probe where it was
            await again.recv()
            return seen[7], (await frame(again))[7]

    seen, after = played(scenario)
    assert seen == pytest.approx(2e-3, abs=1e-4)
    assert after == pytest.approx(2e-3, abs=1e-4)


def test_a_page_that_never_draws_gets_few_frames_and_holds_no_other_up():
    async def scenario(server, url):
        async with connect(url) as slow, connect(url) as quick:
            await slow.recv(), await quick.recv()
            for _ in range(25):
                await frame(quick)
                await quick.send(json.dumps({"drawn": 1}))
            waiting = 0
            while True:
                try:
                    async with asyncio.timeout(0.05):
                        waiting += isinstance(await slow.recv(), bytes)
                except TimeoutError:
                    return waiting

    assert played(scenario, patience=1e9) == 1


def test_a_slow_page_hears_what_was_said_while_it_drew():
    async def scenario(server, url):
        server.session.remark = lambda: "pace"
        async with connect(url) as slow:
            await slow.recv()
            for _ in range(4):  # it never draws: a frame comes when patience ends, and with it the word
                while isinstance(text := await slow.recv(), bytes):
                    pass
                if "told" in json.loads(text):
                    return json.loads(text)["told"]
        return None

    assert played(scenario, patience=0.6) == "pace"


@pytest.mark.parametrize(
    "nonsense", ["{", "[1]", '{"probe": [1, 2]}', '{"probe": [0, 0, "x"]}', '{"probe": [NaN, 0, 0]}', '{"drawn": {}}']
)
def test_nonsense_changes_nothing(nonsense):
    async def scenario(server, url):
        async with connect(url) as socket:
            await socket.recv()
            await socket.send(nonsense)
            await frame(socket)
            return server.session.probe.tolist()

    assert played(scenario) == START


def test_another_sites_page_is_turned_away_and_a_flood_ends_the_connection():
    async def scenario(server, url):
        with pytest.raises(InvalidStatus):
            await connect(url, origin="http://elsewhere.example")
        async with connect(url) as socket:
            await socket.recv()
            await socket.send("x" * 100_000)
            with pytest.raises(ConnectionClosed):
                await frames(socket, 200)
        async with connect(url) as socket:
            return len(await frame(socket))

    assert played(scenario) == 12


def test_a_taken_port_is_said():
    async def scenario(server, url):
        with pytest.raises(InputError, match=f"port {server.port} can't be opened.*--port"):
            await Server(session(), port=server.port).run()

    played(scenario)


def test_the_exported_page_holds_the_model_and_asks_no_network():
    text = page.alone({"title": "</script><b>"})
    assert "<\\/script>" in text
    assert page.SLOT not in text
    assert "http" not in text.replace("location.href.replace(/^http/", "")

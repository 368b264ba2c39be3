"""The page's server: one port for the page and its websocket, one session for every page that is open.

A page gets the next frame when it says that it has drawn the last one, so that a slow one never lags behind; it holds
no other up. What a page sends is checked and otherwise passed over.
"""

import asyncio
import contextlib
import json
import os
import time
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Response

from tissuejax.errors import InputError
from tissuejax.play.page import served
from tissuejax.play.session import Session
from tissuejax.storage import plain

RATE = 60.0  # frames a second at most
PATIENCE = 2.0  # s without an answer after which a frame is sent all the same
BIGGEST = 4096  # bytes of a command


class Server:
    """Serves a session until `stop` is set.

    Attributes:
        pages: connected now. sent: frames in all.
    """

    def __init__(self, session: Session, host: str = "127.0.0.1", port: int = 8765, patience: float = PATIENCE):
        self.session, self.host, self.port, self.patience = session, host, port, patience
        self.pages: dict[ServerConnection, list] = {}
        self.sent, self.stop = 0, asyncio.Event()

    async def run(self, ready=None) -> None:
        """Serve; `ready(url)` is called once the port is open.

        Raises:
            InputError: the port is taken, or is none.
        """
        if not 0 <= self.port <= 65535:
            raise InputError(f"--port {self.port}: wanted is a number of 0 (any that is free) to 65535")
        try:
            server = serve(
                self._page, self.host, self.port, process_request=self._http, max_size=BIGGEST, compression=None
            )
            async with server as listening:
                self.port = listening.sockets[0].getsockname()[1]
                if ready:
                    ready(f"http://{self.host}:{self.port}/")
                ticking = asyncio.create_task(self._tick())
                await self.stop.wait()
                ticking.cancel()
        except OSError as fault:
            raise InputError(
                f"port {self.port} can't be opened ({os.strerror(fault.errno or 0)}): give another --port"
            ) from fault

    def _http(self, connection: ServerConnection, request) -> Response | None:
        if "upgrade" in request.headers.get("Connection", "").lower():
            origin = request.headers.get("Origin")
            allowed = {f"http://{name}:{self.port}" for name in (self.host, "localhost", "127.0.0.1")}
            if origin is not None and origin not in allowed:  # no other site's page may press this probe
                return connection.respond(HTTPStatus.FORBIDDEN, "another origin\n")
            return None
        if request.path.split("?")[0] != "/":
            return connection.respond(HTTPStatus.NOT_FOUND, "there is only /\n")
        body = served().encode()
        headers = Headers(
            {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body)), "Cache-Control": "no-store"}
        )
        return Response(200, "OK", headers, body)

    async def _page(self, connection: ServerConnection) -> None:
        await connection.send(json.dumps({"model": plain(self.session.model)}))
        self.pages[connection] = [0, 0.0, {}]  # number of the frame not yet drawn, when it was sent, words to be told
        with contextlib.suppress(ConnectionClosed):
            async for text in connection:
                try:
                    message = json.loads(text)
                except (ValueError, UnicodeDecodeError):
                    continue
                if not isinstance(message, dict):
                    continue
                if "drawn" in message:
                    self.pages[connection][0] = 0
                self.session.command(message)
        self.pages.pop(connection, None)

    async def _tick(self) -> None:
        last, number, said = time.monotonic(), 0, 0.0
        while True:
            await asyncio.sleep(max(0.0, last + 1 / RATE - time.monotonic()))
            now = time.monotonic()
            try:
                self.session.advance(now - last)
            except Exception as fault:  # a page must not freeze without a word
                self.session.error = str(fault)
            last, number = now, number + 1
            frame = self.session.frame(number)
            words = {"told": self.session.remark()} if now > said + 1 else {}
            said = now if words else said
            if self.session.error:
                words["error"], self.session.error = self.session.error, None
            for state in self.pages.values():  # a slow page hears what was said while it drew
                state[2] |= words
            await asyncio.gather(*(self._send(page, number, frame, now) for page in list(self.pages)))

    async def _send(self, page: ServerConnection, number: int, frame: bytes, now: float) -> None:
        state = self.pages.get(page)
        if state is None or (state[0] and now - state[1] < self.patience):
            return
        words = state[2]
        with contextlib.suppress(ConnectionClosed, asyncio.TimeoutError):
            async with asyncio.timeout(0.5):
                if words:
                    await page.send(json.dumps(words))
                state[:] = number, now, {}
                await page.send(frame)
                self.sent += 1

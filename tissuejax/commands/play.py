"""`tissuejax play`: a surrogate in the browser, in a haptic loop, beside a recording, or as one file to give away."""

import argparse
import asyncio
import contextlib
from pathlib import Path
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.commands.precompute import told
from tissuejax.errors import InputError
from tissuejax.play import blob, page
from tissuejax.play.server import Server
from tissuejax.play.session import SurrogateSession
from tissuejax.surrogate import store
from tissuejax.surrogate.live.ask import Asker


class Play(Command):
    """Serve, export, replay or loop."""

    name: ClassVar[str] = "play"
    order: ClassVar[int] = 46
    summary: ClassVar[str] = "feel and see a probing at the speed of a hand"
    teaches: ClassVar[str] = """
Plays a surrogate (`tissuejax precompute`). Without an option it serves a page on this machine: drag the probe, press
with the wheel, see the force, the relaxation, the inside.

  tissuejax play organ.play.h5                                  open the address that is printed
  tissuejax play organ.play.h5 --export page.html               one file with the model inside, no server, no network
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """FILE and what to do with it."""
        parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="of `tissuejax precompute`")
        parser.add_argument("--export", type=Path, metavar="FILE", help="write a page.html that works alone")
        parser.add_argument("--port", type=int, default=8765, metavar="N", help="of the page (default 8765)")
        parser.add_argument("--seconds", type=float, metavar="S", help="stop after so long (default: at Ctrl-C)")

    def run(self, given: argparse.Namespace) -> Reply:
        """Do it."""
        if given.file is None:
            raise InputError("which FILE? make one with `tissuejax precompute`")
        made = store.read(given.file)
        model = blob.of_surrogate(made, told(made.record)[1:])
        if given.export is not None:
            if given.export.suffix != ".html":
                raise InputError(f"--export {given.export}: wanted is a name that ends in .html")
            path = page.export(model, given.export)
            size = path.stat().st_size
            return Reply({"page": str(path), "bytes": size}, f"page     {path} ({size / 1e6:.1f} MB)")
        return serve(SurrogateSession(model, Asker(made.surrogate)), given)


def serve(session, given: argparse.Namespace) -> Reply:
    """The page's server, until the time is over or Ctrl-C."""

    async def main() -> Server:
        server = Server(session, port=given.port)
        if given.seconds is not None:
            asyncio.get_running_loop().call_later(given.seconds, server.stop.set)
        await server.run(lambda url: None if given.json else print(f"open {url} (Ctrl-C ends)", flush=True))
        return server

    with contextlib.suppress(KeyboardInterrupt):
        server = asyncio.run(main())
        return Reply({"port": server.port, "frames": server.sent}, f"{server.sent} frames sent")
    return Reply({"stopped": True}, "stopped")

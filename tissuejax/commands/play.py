"""`tissuejax play`: feel and see a probing at the speed of a hand, replay a recording, give a model away as a file."""

import argparse
import asyncio
import contextlib
from pathlib import Path
from typing import ClassVar

import h5py
import jax
import numpy as np

from tissuejax.commands.command import Command, Reply
from tissuejax.commands.precompute import counts_of, described, place_of
from tissuejax.commands.tissue_given import Tissue, add_tissue, lobe_of, model_of_record, tissue
from tissuejax.errors import InputError
from tissuejax.play import blob, haply, haptics, page, replay
from tissuejax.play.direct_session import DirectSession
from tissuejax.play.guard import Guard
from tissuejax.play.server import Server
from tissuejax.play.session import Session, SurrogateSession
from tissuejax.play.stored import Run, RunSession
from tissuejax.recordings.files import read
from tissuejax.surrogate import store
from tissuejax.surrogate.live import flat
from tissuejax.surrogate.live.ask import Asker
from tissuejax.surrogate.live.direct import SLOWEST, Direct, direct_scene, keeps_up, largest
from tissuejax.surrogate.places import within_depth
from tissuejax.surrogate.precompute import Precomputed
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.tled import native

FIRST = "12x12x4"  # the mesh of --direct that is tried first


class Play(Command):
    """Serve, export, replay or loop."""

    name: ClassVar[str] = "play"
    order: ClassVar[int] = 46
    summary: ClassVar[str] = "feel and see a probing at the speed of a hand"
    teaches: ClassVar[str] = """
Plays a surrogate (`tissuejax precompute`), a stored run, or the full model. Without an option it serves a page on this
machine: drag the probe, press with the wheel, see the force, the relaxation, the inside.

  tissuejax play organ.play.h5                                     open the address that is printed
  tissuejax play organ.play.h5 --export page.html                  one file with the model inside, no server needed
  tissuejax play organ.play.h5 --export organ.tjf                  the force for C (tissuejax_force.h comes beside it)
  tissuejax play organ.play.h5 --replay organ.h5 --recording r3 --json    force and markers against a recording
  tissuejax play organ.play.h5 --haptics udp:9870 --seconds 60     a loop of 1000 forces a second for a device
  tissuejax play organ.play.h5 --haptics haply                     the same, for the Haply service on this machine
  tissuejax play --direct out/fit --sample organ.h5                TLED in the loop: any place, any effect
  tissuejax play run.h5                                            a stored run, its states and its force

A loop without permission for real-time priority runs and says so. A direct scene slower than life is refused.
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """What is played, and how."""
        add_tissue(parser)
        parser.add_argument("--direct", action="store_true", help="SOURCE as for precompute; simulate in the loop")
        parser.add_argument("--site", metavar="X,Y", help="with --direct: where the mesh is fine, mm")
        parser.add_argument("--mesh", metavar="AxBxC", help="with --direct (default: 12x12x4, or what keeps up)")
        parser.add_argument("--depth", type=float, default=7.0, metavar="MM", help="with --direct: of the wheel")
        parser.add_argument("--export", type=Path, metavar="FILE", help="write page.html or model.tjf")
        parser.add_argument("--replay", metavar="FILE", help="recording file; with --recording NAME")
        parser.add_argument("--haptics", metavar="WHERE", help="udp:PORT, haply, or none (a hand that moves by itself)")
        parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="of the loop (default 1000)")
        parser.add_argument("--force-limit", type=float, default=3.0, metavar="N", help="default 3")
        parser.add_argument("--slew-limit", type=float, default=300.0, metavar="N/S", help="default 300")
        parser.add_argument("--port", type=int, default=8765, metavar="N", help="of the page (default 8765)")
        parser.add_argument("--seconds", type=float, metavar="S", help="stop after so long (default: at Ctrl-C)")

    def run(self, given: argparse.Namespace) -> Reply:
        """Do it."""
        if given.seconds is not None and not 0 <= given.seconds < np.inf:
            raise InputError(f"--seconds {given.seconds:g}: wanted is 0 or more")
        if given.direct:
            return _direct(given, native.wanted())
        if given.source is None:
            raise InputError("which FILE? make one with `tissuejax precompute`, or use --direct")
        if _is_run(given.source):
            return serve(RunSession(Run(given.source), Path(given.source).stem), given)
        made = store.read(given.source)
        if given.export is not None:
            return _export(made, given)
        if given.haptics is not None:
            return _haptics(made, given)
        if given.replay is not None and given.json:
            return _replayed(made, given)
        return serve(SurrogateSession(_model(made, given), Asker(made.surrogate)), given)


def _is_run(path: str) -> bool:
    try:
        with h5py.File(path) as file:
            return "states" in file and "channels" in file
    except OSError:
        return False


def _sample(given: argparse.Namespace):
    sample = read(given.replay)
    name = given.recording or next((n for n, r in sample.recordings.items() if r.experiment == "probing"), "")
    if name not in sample.recordings or sample.recordings[name].experiment != "probing":
        asked = f"--recording {name}" if name else "--replay"
        raise InputError(f"{asked}: {given.replay} has {', '.join(sample.recordings)}; wanted is a probing")
    return sample, name, None if sample.geometry is None else lobe_of(sample)


def _model(made: Precomputed, given: argparse.Namespace) -> dict:
    beside = None
    if given.replay is not None:
        sample, name, lobe = _sample(given)
        beside = replay.for_page(made.surrogate, sample.recordings[name], lobe)
    return blob.of_surrogate(made, described(made.record)[1:], beside)


def _export(made: Precomputed, given: argparse.Namespace) -> Reply:
    if given.export.suffix == ".tjf":
        path = flat.write(made.surrogate, given.export)
        from tissuejax.storage import write_bytes
        from tissuejax.surrogate.live.compiler import source

        header = write_bytes(path.with_name("tissuejax_force.h"), source("tissuejax_force.h").read_bytes())
        record = {"model": str(path), "header": str(header), "bytes": path.stat().st_size}
        return Reply(record, f"model    {path}\nheader   {header}")
    if given.export.suffix != ".html":
        raise InputError(f"--export {given.export}: wanted is a name that ends in .html or .tjf")
    path = page.export(_model(made, given), given.export)
    size = path.stat().st_size
    return Reply({"page": str(path), "bytes": size}, f"page     {path} ({size / 1e6:.1f} MB)")


def _haptics(made: Precomputed, given: argparse.Namespace) -> Reply:
    seconds = 60.0 if given.seconds is None else given.seconds
    if given.haptics == "haply":
        s = made.surrogate
        middle = (np.asarray(s.low) + np.asarray(s.high)) / 2
        centre = np.append(middle, s.touch.sample(middle[None])[0, 0])
        guard = Guard(given.force_limit, given.slew_limit)
        record = asyncio.run(haply.follow(Asker(s), guard, centre, seconds))
        return Reply(record, f"{record['answered']} forces at {record['rate_Hz']:.0f} Hz; not real time (Python)")
    port = haptics.port_of(given.haptics)
    found = haptics.loop(made.surrogate, port, seconds, given.rate, given.force_limit, given.slew_limit)
    return Reply(found.record, haptics.summary(found.record))


def _replayed(made: Precomputed, given: argparse.Namespace) -> Reply:
    sample, name, lobe = _sample(given)
    model, values = model_of_record(made.record["model"])
    record = replay.compared(made.surrogate, sample, name, lobe, model, values)
    return Reply(record, str(record))


def _direct(given: argparse.Namespace, in_c: bool) -> Reply:
    jax.config.update("jax_cpu_enable_async_dispatch", False)  # another thread costs a call half as much again
    what: Tissue = tissue(given)
    place = what.site if given.site is None else place_of(given.site)
    within_depth(what.matter.lobe, place[None], given.depth / 1e3)
    grid = Grid(counts_of(given.mesh or FIRST), what.matter.radius)

    def ready(grid: Grid) -> Direct:
        return Direct(direct_scene(what.matter, grid, place), given.depth / 1e3)

    direct = ready(grid)
    pace = direct.pace()
    if given.mesh is None and pace.times_life < SLOWEST:
        grid = largest(pace, grid)
        direct = ready(grid)
        pace = direct.pace()
    keeps_up(pace, grid)
    mesh = "x".join(map(str, grid.counts))
    words = f"mesh {mesh}: {pace.times_life:.1f} times life, a call of {1e3 * direct.call:.2g} ms takes "
    words += f"{pace.call_p50_ms:.2f} ms (p50), {pace.call_p99_ms:.2f} ms (p99)"
    if given.seconds == 0:
        loop = "C" if in_c else "XLA"
        return Reply({"mesh": list(grid.counts), "pace": pace._asdict(), "element_loop": loop}, words)
    if not given.json:
        print(words, flush=True)
    title = "slab" if what.sample is None else what.sample.name
    return serve(DirectSession(direct, pace, place, given.depth / 1e3, title, "the full model in the loop"), given)


def serve(session: Session, given: argparse.Namespace) -> Reply:
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

"""Dask: a cluster of this machine, or a scheduler elsewhere (`--scheduler tcp://...`, by dask-jobqueue on Slurm).

Workers need the same files under the same paths and the campaign's folder, as on a cluster's common file system.
"""

import logging
import signal
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from typing import Any, ClassVar

from tissuejax.campaign.engine import Engine, Report, work
from tissuejax.campaign.store import Store
from tissuejax.campaign.task import Task
from tissuejax.errors import InputError, NotConverged

DEATHS = 2  # times a case may take its worker with it before Dask gives it up


class Dask(Engine):
    """Worker processes of one thread each; a limit in seconds is kept by a child of the worker (`child`)."""

    name: ClassVar[str] = "dask"

    def run(self, store: Store, tasks: list[Task], workers: int, report: Report, where: str | None = None) -> None:
        """See `Engine.run`.

        Raises:
            InputError: dask.distributed is missing, or no scheduler answers at the address.
        """
        try:
            import dask.config
            from distributed import Client, KilledWorker, LocalCluster, as_completed
            from distributed.comm.core import CommClosedError
        except ImportError as error:
            raise InputError("engine dask needs the extra `cluster`: pip install 'tissuejax[cluster]'") from error
        dask.config.set({"distributed.scheduler.allowed-failures": DEATHS, "distributed.worker.daemon": False})
        folder = str(store.folder.resolve())
        with quiet(), ExitStack() as ending:
            cluster = None
            if where is None:
                mute: dict[str, Any] = {"dashboard_address": None, "silence_logs": logging.CRITICAL}
                cluster = LocalCluster(n_workers=0, threads_per_worker=1, processes=True, **mute)
                ending.callback(cluster.close)
                cluster.sync(deaf)
                cluster.scale(workers)
            try:
                client = Client(where or cluster, timeout=20)
            except (OSError, TimeoutError) as error:
                raise InputError(f"no Dask scheduler answers at {where} ({error}); check the address") from error
            ending.callback(closed, client)
            plain = [t.plain() for t in tasks]
            try:
                futures = client.map(work, [folder] * len(tasks), plain, pure=False, batch_size=1000)
                for future in as_completed(futures):
                    try:
                        report(future.result())
                    except KilledWorker:
                        continue  # left missing; the store counted how often it was begun
            except (CommClosedError, CancelledError) as error:
                at, again = (f" at {where}", " --scheduler ADDRESS") if where else ("", "")
                raise NotConverged(
                    f"the Dask scheduler{at} is gone; what was finished is kept: start it again and go on with "
                    f"`tissuejax campaign resume {store.folder} --engine dask{again}`"
                ) from error


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing of Dask's own log in this process: what it would tell is an exception here, or a row of the store."""
    kept = {}
    for name in ("distributed", *logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            kept[name] = logging.getLogger(name).level
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in kept.items():
            logging.getLogger(name).setLevel(level)


async def deaf() -> None:
    """Keep Ctrl-C from this thread and from the workers it begins, which inherit that: the client ends them."""
    if hasattr(signal, "pthread_sigmask"):
        resource_tracker.ensure_running()  # begun later, it would let the signal in again
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def closed(client) -> None:
    """Close a client whose scheduler may be gone."""
    with suppress(TimeoutError, OSError):  # a closed channel is an OSError
        client.close(timeout=5)

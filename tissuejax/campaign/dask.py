"""Dask: a cluster of this machine, or a scheduler elsewhere (`--scheduler tcp://...`, by dask-jobqueue on Slurm).

Workers need the same files under the same paths and the campaign's folder, as on a cluster's common file system.
"""

from concurrent.futures import CancelledError
from contextlib import suppress
from typing import ClassVar

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
            import dask
            from distributed import Client, KilledWorker, LocalCluster, as_completed
            from distributed.comm import CommClosedError
        except ImportError as error:
            raise InputError("engine dask needs the extra `cluster`: pip install 'tissuejax[cluster]'") from error
        dask.config.set({"distributed.scheduler.allowed-failures": DEATHS, "distributed.worker.daemon": False})
        cluster = None
        if where is None:
            cluster = LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None)
        try:
            client = Client(where or cluster, timeout=20)
        except (OSError, TimeoutError) as error:
            raise InputError(f"no Dask scheduler answers at {where} ({error}); check the address") from error
        folder = str(store.folder.resolve())
        try:
            futures = client.map(work, [folder] * len(tasks), [t.plain() for t in tasks], pure=False, batch_size=1000)
            for future in as_completed(futures):
                try:
                    report(future.result())
                except KilledWorker:
                    continue  # left missing; the store counted how often it was begun
        except (CommClosedError, CancelledError) as error:
            raise NotConverged(
                f"the Dask scheduler{f' at {where}' if where else ''} is gone ({error}); what was finished is kept: "
                "start it again and go on with `tissuejax campaign resume`"
            ) from error
        finally:
            with suppress(TimeoutError, OSError, CommClosedError):
                client.close(timeout=5)
            if cluster is not None:
                cluster.close()

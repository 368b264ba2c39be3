"""Workers end with the process that they work for, also where it was killed and they are in the middle of a case."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import tissuejax
from tissuejax.parent import pool

BUSY = """
import time

def busy(*_):
    print("ready", flush=True)
    time.sleep(600)

if __name__ == "__main__":
"""
POOL = """
    from tissuejax.parent import pool
    with pool(2) as crew:  # one is busy, the other waits for a case
        crew.submit(busy)
"""
CHILD = """
    from tissuejax.campaign.child import Child
    Child(busy).answer("", {}, 600.0)
"""
HELPER = """
    from tissuejax.experiments.workers import Worker
    worker = Worker()
    worker.ask((0,), time.sleep)
    print("ready", flush=True)
    worker.ask((600,), time.sleep)
"""


@pytest.mark.parametrize("kill", [signal.SIGKILL, signal.SIGTERM], ids=["SIGKILL", "SIGTERM"])
@pytest.mark.parametrize("body", [POOL, CHILD, HELPER], ids=["pool", "child", "helper"])
def test_workers_of_a_killed_process_are_gone_within_seconds(tmp_path, body, kill):
    (tmp_path / "go.py").write_text(BUSY + body)
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "go.py")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(kill)
        process.communicate(timeout=30)  # until nobody holds the error stream any more, which workers have from it
    assert process.returncode == -kill


def test_every_pool_of_the_package_is_of_this_kind():
    room = Path(tissuejax.__file__).parent
    assert [p.name for p in room.rglob("*.py") if "ProcessPoolExecutor(" in p.read_text()] == ["parent.py"]


@pytest.mark.parametrize(("workers", "threads"), [(1, None), (2, "1")])
def test_several_workers_compute_on_one_thread_each(workers, threads, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with pool(workers) as crew:
        assert crew.submit(os.getenv, "OMP_NUM_THREADS").result() == threads
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    with pool(workers) as crew:
        assert crew.submit(os.getenv, "OMP_NUM_THREADS").result() == "3"

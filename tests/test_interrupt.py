"""Ctrl-C ends a command once and for all, whatever its main thread is doing."""

import os
import signal
import subprocess
import sys

import pytest

from tissuejax.cli import main

CALL = """
from tissuejax.interrupt import stop, watched
watched("fit")
try:
    {}
except KeyboardInterrupt:
    stop("fit")
"""
READY = "print('ready', flush=True)"
DEAF = f"import hashlib; {READY}; hashlib.pbkdf2_hmac('sha256', b'', b'', 2**31 - 1)"  # minutes in C, deaf to signals
HEARING = f"import time; {READY}; time.sleep(600)"
WORKING = (
    "from tissuejax.experiments import workers; w = workers.Worker(); workers._workers.append(w); "
    f"print(w.process.pid, flush=True); {DEAF}"
)


@pytest.mark.parametrize("body", [DEAF, HEARING], ids=["in the middle of a compilation", "between two lines"])
def test_ctrl_c_is_enough_once(body):
    with subprocess.Popen(
        [sys.executable, "-c", CALL.format(body)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "tissuejax fit: stopped\n"


def test_a_campaign_says_how_it_goes_on(monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("tissuejax.commands.campaign.status", stopped)
    assert main(["campaign", "status", "c"]) == 130
    assert capsys.readouterr().err.startswith("tissuejax campaign: stopped; what is finished is kept: ")
    monkeypatch.setattr("tissuejax.commands.inspecting.names", stopped)
    assert main(["inspect", "c.h5"]) == 130
    assert capsys.readouterr().err == "tissuejax inspect: stopped\n"


def test_no_worker_is_left_behind():
    with subprocess.Popen([sys.executable, "-c", CALL.format(WORKING)], stdout=subprocess.PIPE, text=True) as process:
        worker = int(process.stdout.readline())
        assert process.stdout.readline() == "ready\n"
        os.kill(worker, 0)
        process.send_signal(signal.SIGINT)
        process.wait(timeout=60)
    assert process.returncode == 130
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)

"""Ctrl-C on the command line: once is enough, also while a program is being compiled.

Python hears a signal between two of its own instructions, and a compilation is one of them that may take half a minute;
and an interpreter that is torn down while another thread compiles crashes. So a thread of its own waits for the signal
and ends the process where the main thread doesn't hear it in time, and an interrupted command ends without a teardown:
results are written aside and renamed, so nothing is left half written.
"""

import multiprocessing
import os
import signal
import socket
import sys
import threading
from typing import NoReturn

PATIENT = 2.0  # s that the main thread has to hear of it
CODE = 130
_kept: list[socket.socket] = []  # a file descriptor lives as long as its socket


def watched(name: str, more: str = "") -> None:
    """From now on Ctrl-C ends this process, be it in the middle of a compilation; in the main thread of a command.

    Args:
        name: of the command, for what is said.
        more: said beside it.
    """
    heard, (ours, theirs) = threading.Event(), socket.socketpair()
    theirs.setblocking(False)

    def hears(number, frame):
        heard.set()
        signal.default_int_handler(number, frame)

    def waits():
        while signal.SIGINT not in ours.recv(64):
            pass
        if not heard.wait(PATIENT):
            stop(name, more)

    signal.signal(signal.SIGINT, hears)
    signal.set_wakeup_fd(theirs.fileno())
    _kept.append(theirs)
    threading.Thread(target=waits, daemon=True).start()


def said(name: str, more: str = "") -> str:
    """The line on a command that was stopped."""
    return f"tissuejax {name}: stopped" + (f"; {more}" if more else "")


def stop(name: str, more: str = "") -> NoReturn:
    """Say that a command was stopped, end what works for it, and end the process."""
    print(said(name, more), file=sys.stderr)
    sys.stdout.flush()
    for child in multiprocessing.active_children():
        child.terminate()
    if "tissuejax.experiments.workers" in sys.modules:
        sys.modules["tissuejax.experiments.workers"].close_all()
    sys.stderr.flush()
    os._exit(CODE)

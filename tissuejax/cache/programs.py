"""Compiled programs kept on disk, so that a second run starts at once. The one place that says where.

Environment: TISSUEJAX_CACHE names the folder ("" or "off" switches it off); default is the user's cache folder.
"""

import gc
import hashlib
import os
import stat
import threading
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax import export

from tissuejax.cache.key import key as key_of
from tissuejax.errors import InputError
from tissuejax.storage import write_bytes

ENVIRONMENT = "TISSUEJAX_CACHE"
WORTHWHILE = 0.3  # s of compilation from which a program is kept
TRACED = "traced"  # subfolder of what tracing gave
MARK = 32  # bytes of a hash
# XLA's newer fusion emitters take twice as long to compile algebra over a thousand samples, and run it no faster
QUICKLY = {"xla_cpu_use_fusion_emitters": False}
_all: weakref.WeakSet["Kept"] = weakref.WeakSet()
MOST = 1000  # files kept there, of a tenth of a megabyte each


def folder() -> Path | None:
    """Where programs are kept; None if switched off."""
    chosen = os.environ.get(ENVIRONMENT)
    if chosen is not None and chosen.lower() in ("", "off"):
        return None
    root = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return Path(chosen) if chosen else root / "tissuejax" / "programs"


def keep_programs() -> None:
    """Switch the disk cache on, unless it is switched off or JAX was already told of another one."""
    where = folder()
    if where is None or jax.config.jax_compilation_cache_dir is not None:
        return
    try:
        where.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError:  # a read-only home: compile again each time
        return
    if not own(where):
        return
    jax.config.update("jax_compilation_cache_dir", str(where))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTHWHILE)


ANOTHERS, OPEN_TO_ALL = "belongs to another user", "may be written by others"
ADVICE = {ANOTHERS: "", OPEN_TO_ALL: "`chmod go-w` it, or "}


def own(where: Path) -> bool:
    """Whether a folder is this user's and nobody else may write there; says so once where it isn't.

    A kept program is code: whoever can write the folder could have this user run another one.
    """
    whose = strangers(where)
    if whose:
        warnings.warn(
            f"{where} {whose}, so no compiled programs are kept or taken there: {ADVICE[whose]}name another folder in "
            f"{ENVIRONMENT}",
            stacklevel=3,
        )
    return not whose


def strangers(where: Path) -> str:
    """Who else may write in a folder, in words; empty if nobody, or if there is no such folder."""
    if not hasattr(os, "getuid") or not where.exists():
        return ""
    seen = where.stat()
    if seen.st_uid != os.getuid():
        return ANOTHERS
    return OPEN_TO_ALL if seen.st_mode & (stat.S_IWGRP | stat.S_IWOTH) else ""


def forget_programs() -> None:
    """Drop all compiled programs of this process."""
    for kept in tuple(_all):
        kept.forget()
    jax.clear_caches()
    gc.collect()


class Kept:
    """A function compiled once for every shape of its arguments, and kept on disk with what tracing gave.

    JAX keeps what its compiler makes, but traces the function anew in every process to find it again: for a model with
    fibres in a compliant rig that takes 3 s, and reading it here 0.2 s. A trace is kept as `jax.export` writes it.
    """

    def __init__(self, function: Callable, said: str | None):
        """
        Args:
            function: of trees of arrays, of which it returns one.
            said: all that it depends on beside its arguments, this package and the libraries, as text; None if that
                can't be told: then it is traced in every process.
        """
        self._function, self._said = function, said
        self._known: dict[Any, Future[Callable]] = {}
        self._asking = threading.Lock()
        _all.add(self)

    def forget(self) -> None:
        """Drop what was compiled; it is made again, or read from the disk, when it is called."""
        self._known.clear()

    def __call__(self, *arguments: Any) -> Any:
        """The function's value."""
        leaves, tree = jax.tree.flatten(arguments)
        return self._program(tree, leaves)(*leaves)

    def compiled(self, *arguments: Any) -> Callable:
        """The program for arguments of these shapes, which takes their leaves: who calls it thousands of times need not
        have it found each time. Who asks for it while it is compiled waits for that."""
        leaves, tree = jax.tree.flatten(arguments)
        return self._program(tree, leaves)

    def _program(self, tree: Any, leaves: list) -> Callable:
        # asking NumPy for shape and type of what has them takes as long as a short program
        arrays = (x if isinstance(x, np.ndarray | jax.Array) else np.asarray(x) for x in leaves)
        key = (tree, tuple([(x.shape, x.dtype) for x in arrays]))
        with self._asking:
            promised = self._known.get(key)
            mine = promised is None
            if mine:
                promised = self._known[key] = Future()
        if mine:
            try:
                promised.set_result(
                    jax.jit(self._traced(key, leaves), compiler_options=QUICKLY).lower(*leaves).compile()
                )
            except BaseException as error:
                self._known.pop(key, None)
                promised.set_exception(error)
        return promised.result()

    def _traced(self, key: tuple, leaves: list) -> Callable:
        def flat(*leaves):
            return self._function(*jax.tree.unflatten(key[0], leaves))

        path = self._path(repr(key))
        if path is None:
            return flat
        found = _read(path)
        if found is None:
            try:
                found = export.export(jax.jit(flat))(*leaves)
                _keep(path, found.serialize())
            except Exception:  # JAX says in many ways that a program (it calls back into Python) has no form on disk
                return flat
        return found.call

    def _path(self, key: str) -> Path | None:
        where = jax.config.jax_compilation_cache_dir
        if self._said is None or where is None or "://" in where or not own(Path(where)):
            return None
        name = key_of(self._said, key)
        return None if name is None else Path(where) / TRACED / f"{name}.bin"


@contextmanager
def ahead(calls: Iterable[tuple[Kept, tuple]]) -> Iterator[None]:
    """While the block runs, compile what these calls will need, in this order, on all cores that this process may use.

    The compiler runs beside Python. What has not been begun when the block ends is not compiled; what fails, fails
    where it is called.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    pool = ThreadPoolExecutor(cores, thread_name_prefix="ahead")
    try:
        for kept, arguments in calls:
            pool.submit(kept.compiled, *arguments)
        yield
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _read(path: Path) -> export.Exported | None:
    """What tracing gave, from a file; None if there is none that can be used, whatever the reason: it is made anew.

    A file ends in the hash of what stands before: JAX does not notice that one was cut off.
    """
    try:
        content = path.read_bytes()
        if hashlib.sha256(content[:-MARK]).digest() != content[-MARK:]:
            return None
        found = export.deserialize(bytearray(content[:-MARK]))
        os.utime(path)
    except Exception:
        return None
    return found


def _keep(path: Path, content: bytes) -> None:
    """Write what tracing gave, if the folder can be written, and remove the oldest where there are too many."""
    try:
        write_bytes(path, content + hashlib.sha256(content).digest())
        for old in sorted(path.parent.glob("*.bin"), key=lambda p: p.stat().st_mtime)[:-MOST]:
            old.unlink(missing_ok=True)
    except (InputError, OSError):
        return

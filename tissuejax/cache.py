"""Compiled programs kept on disk, so that a second run starts at once. The one place that says where.

Environment: TISSUEJAX_CACHE names the folder ("" or "off" switches it off); default is the user's cache folder.
"""

import hashlib
import os
import pickle
import platform
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from tissuejax.storage import write_bytes

ENVIRONMENT = "TISSUEJAX_CACHE"
WORTHWHILE = 0.3  # s of compilation from which a program is kept
WHOLE = "whole"  # subfolder of programs that are found without tracing
MOST = 300  # programs kept there; about a megabyte each
LIBRARIES = ("jax", "jaxlib", "numpy", "equinox", "diffrax", "optimistix", "lineax")  # that a trace passes through


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
        where.mkdir(parents=True, exist_ok=True)
    except OSError:  # a read-only home: compile again each time
        return
    jax.config.update("jax_compilation_cache_dir", str(where))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTHWHILE)


class Kept:
    """A function compiled once for every shape of its arguments, and kept beside JAX's own cache.

    JAX keeps what its compiler makes, but traces the function anew in every process to find it again: for a model
    with fibres in a compliant rig that is 3.3 s of 4.1 s. Here the program's name is known without tracing.
    """

    def __init__(self, function: Callable, said: str | None):
        """
        Args:
            function: of trees of arrays, of which it returns one.
            said: all that it depends on beside its arguments, this package and the libraries, as text; None if that
                can't be told: then nothing is kept on disk.
        """
        self._function, self._said = function, said
        self._known: dict[Any, Callable] = {}

    def __call__(self, *arguments: Any) -> Any:
        """The function's value."""
        leaves, tree = jax.tree.flatten(arguments)
        key = (tree, tuple((np.shape(x), np.result_type(x).str) for x in leaves))
        if key not in self._known:
            self._known[key] = self._program(key, leaves)
        return self._known[key](*leaves)

    def _program(self, key: tuple, leaves: list) -> Callable:
        tree = key[0]
        path = self._path(repr(key))
        if path is not None and (known := _loaded(path)) is not None:
            return known

        def flat(*leaves):
            return self._function(*jax.tree.unflatten(tree, leaves))

        made = jax.jit(flat).lower(*leaves).compile()
        if path is not None:
            _keep(path, made)
        return made

    def _path(self, key: str) -> Path | None:
        where = jax.config.jax_compilation_cache_dir
        if self._said is None or where is None or "://" in where:
            return None
        name = hashlib.sha256("\n".join((_circumstances(), _settings(), self._said, key)).encode()).hexdigest()
        return Path(where) / WHOLE / f"{name}.pickle"


def _loaded(path: Path) -> Callable | None:
    """The program in a file; None if there is none that can be used, whatever the reason: it is made again."""
    try:
        program = deserialize_and_load(*pickle.loads(path.read_bytes()))
        os.utime(path)
    except Exception:
        return None
    return program


def _keep(path: Path, program: Any) -> None:
    """Write a program; one that can't be (it calls back into Python, the disk is full) is made again next time."""
    try:
        write_bytes(path, pickle.dumps(serialize(program)))
        files = sorted(path.parent.glob("*.pickle"), key=lambda p: p.stat().st_mtime)
        for old in files[:-MOST]:
            old.unlink(missing_ok=True)
    except Exception:  # JAX says in many ways that a program has no form on disk
        return


@lru_cache(maxsize=1)
def _circumstances() -> str:
    """All that a program depends on beside its function: this package's source, the libraries, the processor."""
    root = Path(__file__).parent
    source = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        source.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = sorted({line for line in lines if line.startswith(("flags", "model name", "Features"))})
    except OSError:
        processor = [platform.processor(), platform.node()]
    libraries = [f"{name} {version(name)}" for name in LIBRARIES]
    return "\n".join([source.hexdigest(), platform.python_version(), platform.machine(), *processor, *libraries])


def _settings() -> str:
    """JAX's settings that change a program."""
    c = jax.config
    said = (c.jax_enable_x64, c.jax_debug_nans, c.jax_default_matmul_precision, jax.default_backend())
    return repr((*said, jax.device_count(), os.environ.get("XLA_FLAGS", "")))

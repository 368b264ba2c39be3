"""A C compiler, where there is one: programs compiled once, kept by the hash of their text, and given to XLA by name.

With `TISSUEJAX_NATIVE=off`, and where no compiler is, all is left to XLA: the same results to rounding.
"""

import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import threading
from pathlib import Path

import jax

from tissuejax.cache.programs import own

ENVIRONMENT = "TISSUEJAX_NATIVE"
# compilers take half of an AVX-512 register unless told: a fifth (float32) to a third (float64) of a step
WIDE = ("-mprefer-vector-width=512",) if platform.machine().lower() in ("x86_64", "amd64") else ()
FLAGS = ("-O2", "-ftree-vectorize", "-march=native", "-std=gnu11", "-shared", "-fPIC", "-fopenmp-simd",
         "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fno-tree-pre", "-w", *WIDE)  # fmt: skip
# half of the time to compile, fewer instructions and spills, a step as quick: what vectors need is asked for above, and
# registers of a large program are allotted without a table of all their conflicts
GCC = ("-O1", "--param=ira-max-conflict-table-size=1")
VECTOR_MATH = ('-DSIMD=__attribute__((__simd__("notinbranch"),const))', "-lmvec")  # glibc's, where it has them
KEPT = "native"  # subfolder of the programs that are kept

_lock = threading.Lock()
_loaded: dict[str, ctypes.CDLL] = {}


class NotCompiled(Exception):
    """The compiler refused."""


@functools.cache
def compiler() -> str | None:
    """The C compiler; None where none is found or JAX computes elsewhere than on the CPU."""
    if jax.default_backend() != "cpu":
        return None
    named = os.environ.get("CC")
    return next((found for name in (named, "cc", "gcc", "clang") if name and (found := shutil.which(name))), None)


@functools.cache
def _version() -> str:
    """What the compiler says of itself."""
    return subprocess.run([str(compiler()), "--version"], capture_output=True, text=True, check=False).stdout


def _flags() -> tuple[str, ...]:
    return (*FLAGS, *GCC) if "Free Software Foundation" in _version() else FLAGS


@functools.cache
def _around() -> str:
    """What a compiled program depends on beside its text: compiler, processor, JAX."""
    try:
        seen = Path("/proc/cpuinfo").read_text()
        flags = next((line for line in seen.splitlines() if line.startswith(("flags", "Features"))), "")
    except OSError:
        flags = platform.processor()
    return "\n".join((_version(), flags, platform.machine(), jax.__version__, " ".join((*_flags(), *VECTOR_MATH))))


def named(text: str) -> str:
    """Compile a program, unless it was before, and register its handler with XLA; the name to call it by.

    Raises:
        NotCompiled: the compiler refused.
    """
    name = "tissuejax_" + hashlib.sha256(f"{_around()}\n{text}".encode()).hexdigest()[:32]
    with _lock:
        if name not in _loaded:
            # that of `cache.programs`, unless JAX was told of another
            where = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]: made at run time
            kept = None if where is None or "://" in where or not own(Path(where)) else Path(where) / KEPT
            found = _load(kept / f"{name}.so") if kept is not None else None
            if found is None:
                found = _compiled(text, name, kept)
            jax.ffi.register_ffi_target(name, jax.ffi.pycapsule(found.handler), platform="cpu")
            _loaded[name] = found
    return name


def _load(path: Path) -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(str(path)) if path.exists() else None
    except OSError:
        return None


def _compiled(text: str, name: str, kept: Path | None) -> ctypes.CDLL:
    with tempfile.TemporaryDirectory() as scratch:
        source, made = Path(scratch, f"{name}.c"), Path(scratch, f"{name}.so")
        source.write_text(text)
        include = f"-I{jax.ffi.include_dir()}"
        output = ""
        for extra in (VECTOR_MATH, ()):
            command = [str(compiler()), *_flags(), include, str(source), "-o", str(made), *extra, "-lm", "-Wl,-z,defs"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            found = _load(made) if done.returncode == 0 else None
            if found is not None:
                _keep(made, kept)
                return found
            output = done.stderr
        raise NotCompiled(output[-500:])


def _keep(made: Path, kept: Path | None) -> None:
    if kept is None:
        return
    try:
        kept.mkdir(parents=True, exist_ok=True, mode=0o700)
        aside = kept / f".{made.name}.{os.getpid()}"
        shutil.copyfile(made, aside)
        os.replace(aside, kept / made.name)
    except OSError:
        return

"""C of ours, compiled on the user's machine when first needed and kept in the cache folder."""

import hashlib
import os
import shutil
import subprocess
import tempfile
from importlib.resources import files
from pathlib import Path

from tissuejax.cache.programs import ADVICE, ENVIRONMENT, strangers
from tissuejax.errors import InputError

FLAGS = ("-std=c99", "-O3", "-march=native", "-ffp-contract=fast", "-Wall", "-Wextra")
WORD = "no C compiler (cc, gcc or clang) is on this machine, and the haptic loop is compiled here; install one"


def folder() -> Path:
    """Where compiled programs are kept: the user's cache folder, or a temporary one where nothing is to be kept."""
    named = os.environ.get("TISSUEJAX_CACHE", "")
    if named and named != "off":
        return Path(named) / "compiled"
    if named == "off":
        return Path(tempfile.gettempdir()) / f"tissuejax-{os.getuid()}"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "tissuejax" / "compiled"


def compiler() -> str:
    """The C compiler.

    Raises:
        InputError: there is none.
    """
    for name in filter(None, (os.environ.get("CC"), "cc", "gcc", "clang")):
        if shutil.which(name):
            return name
    raise InputError(WORD)


def source(name: str) -> Path:
    """A C file that comes with the package."""
    return Path(str(files("tissuejax.surrogate") / "live" / name))


def compiled(name: str, shared: bool = False) -> Path:
    """The program (or shared library) made of `name`.

    Raises:
        InputError: no compiler, one that refuses the file (its words are shown), or a folder others may write.
    """
    cc, text = compiler(), source(name).read_bytes() + source("tissuejax_force.h").read_bytes()
    key = hashlib.sha256(text + repr((cc, FLAGS, shared)).encode()).hexdigest()[:16]
    target = folder() / f"{Path(name).stem}-{key}{'.so' if shared else ''}"
    if whose := strangers(target.parent):
        raise InputError(
            f"{target.parent} {whose}, and programs are run from there: {ADVICE[whose]}name another folder in "
            f"{ENVIRONMENT}"
        )
    if target.is_file():
        return target
    target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    half = target.with_name(f".{os.getpid()}.{target.name}")
    kind = ["-shared", "-fPIC"] if shared else []
    done = subprocess.run(
        [cc, *FLAGS, *kind, "-I", str(source(name).parent), "-o", str(half), str(source(name)), "-lm"],
        capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        raise InputError(f"{cc} does not compile {name}: {done.stderr.strip()[:400]}; try another compiler (CC=...)")
    os.replace(half, target)
    return target

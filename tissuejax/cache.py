"""Compiled programs kept on disk, so that a second run starts at once. The one place that says where.

Environment: TISSUEJAX_CACHE names the folder ("" or "off" switches it off); default is the user's cache folder.
"""

import os
from pathlib import Path

import jax

ENVIRONMENT = "TISSUEJAX_CACHE"
WORTHWHILE = 0.3  # s of compilation from which a program is kept


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

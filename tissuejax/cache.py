"""Compiled programs kept on disk, so that the next run of the same kind starts at once."""

import os
from pathlib import Path

import jax


def folder() -> Path:
    """Where compiled programs are kept: TISSUEJAX_CACHE, or `tissuejax` in the user's cache folder."""
    chosen = os.environ.get("TISSUEJAX_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tissuejax"


def keep_programs() -> None:
    """Let JAX keep whatever takes longer than 0.3 s to compile; leaves a cache that the user has set up alone.

    The cache is keyed by program, JAX version and processor; deleting the folder is always safe.
    """
    if jax.config.jax_compilation_cache_dir is None:
        jax.config.update("jax_compilation_cache_dir", str(folder() / "programs"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)

"""Compiled simulation programs, each compiled once and one at a time, then run from any thread.

`jax.jit` alone would compile the same program in every thread that asks for it first, and on few cores
compilations side by side only hinder each other.
"""

import threading
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from tissuejax.tled.simulate import COMPILER_OPTIONS

_lock = threading.Lock()
_compiled: dict[Any, Callable] = {}


def run(function: Callable, static: Any, *arguments: Any) -> Any:
    """`function(static, *arguments)` as a compiled program; inside another transformation simply the function.

    Args:
        function: pure JAX; `static` is its hashable first argument.
        arguments: pytrees of arrays; programs are shared by arguments of equal structure, shapes and precision.
    """
    if any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(arguments)):
        return function(static, *arguments)
    arguments = jax.tree.map(jnp.asarray, arguments)
    leaves, structure = jax.tree.flatten(arguments)
    key = (function, static, structure, tuple((leaf.shape, leaf.dtype) for leaf in leaves))
    if key not in _compiled:
        with _lock:
            if key not in _compiled:
                jitted = jax.jit(function, static_argnums=0, compiler_options=COMPILER_OPTIONS)
                _compiled[key] = jitted.lower(static, *arguments).compile()
    return _compiled[key](*arguments)

"""Compiled simulation programs, each compiled once and one at a time, then run.

`jax.jit` alone would compile the same program in every thread that asks for it first, and on few cores compilations
side by side only hinder each other. Programs run one at a time in a process: two at once wait for ever (seen with jax
0.10.2 on CPU; `workers` uses processes instead).
"""

import threading
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from tissuejax.arrays import traced
from tissuejax.tled.simulate import COMPILER_OPTIONS

_lock, _running = threading.Lock(), threading.Lock()
_compiled: dict[Any, Callable] = {}


def run(function: Callable, static: Any, *arguments: Any) -> Any:
    """`function(static, *arguments)` as a compiled program; inside another transformation simply the function.

    Args:
        function: pure JAX; `static` is its hashable first argument.
        arguments: pytrees of arrays; programs are shared by arguments of equal structure, shapes and precision.
    """
    if traced(*jax.tree.leaves(arguments)):
        return function(static, *arguments)
    arguments = jax.tree.map(jnp.asarray, arguments)
    program = _program(function, static, *arguments)
    with _running:
        return jax.block_until_ready(program(*arguments))


def compiled(function: Callable, static: Any, *arguments: Any) -> None:
    """Have the program of `run` compiled (and kept on disk), without running it."""
    _program(function, static, *jax.tree.map(jnp.asarray, arguments))


def _program(function: Callable, static: Any, *arguments: Any) -> Callable:
    leaves, structure = jax.tree.flatten(arguments)
    key = (function, static, structure, tuple((leaf.shape, leaf.dtype) for leaf in leaves))
    if key not in _compiled:
        with _lock:
            if key not in _compiled:
                jitted = jax.jit(function, static_argnums=0, compiler_options=COMPILER_OPTIONS)
                _compiled[key] = jitted.lower(static, *arguments).compile()
    return _compiled[key]

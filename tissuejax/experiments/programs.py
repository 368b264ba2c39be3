"""Compiled simulation programs, each compiled once and one at a time, then run from any thread.

`jax.jit` alone would compile the same program in every thread that asks for it first, and on few cores
compilations side by side only hinder each other.

XLA's CPU client runs an asynchronous program on its own pool of threads, one a core, and the program then waits for
parts that it hands to the same pool: as many programs at once as there are cores wait for ever (seen with jax 0.10.2).
So programs are run by the thread that asks, which must be said before JAX makes its client: at this module's import.
"""

import threading
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax._src import xla_bridge  # no public way to ask whether the client is there

from tissuejax.tled.simulate import COMPILER_OPTIONS

PARALLEL = not xla_bridge.backends_are_initialized()  # else it is too late to say, and programs run one after another
jax.config.update("jax_cpu_enable_async_dispatch", False)

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

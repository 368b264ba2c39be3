"""The key of everything that is kept on disk: code, libraries, settings of JAX, and all inputs, however nested.

Nothing is kept of what can't be told in full. A law from a user's script is known by its name alone, its formula is
not; so wherever one is met, at the top or inside another, there is no key.
"""

import dataclasses
import enum
import functools
import hashlib
import os
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import PurePath

import jax
import numpy as np

from tissuejax.cache import source

LIBRARIES = ("jax", "jaxlib", "numpy", "scipy", "equinox", "diffrax", "optimistix", "optax", "lineax")
FLAGS = ("XLA_FLAGS", "TISSUEJAX_NATIVE", "JAX_DEFAULT_MATMUL_PRECISION", "JAX_ENABLE_X64", "JAX_NUMERICS")
KNOWN = ("tissuejax", *LIBRARIES)  # packages whose code is part of the key, by hash or by version


class Untold(Exception):
    """Something of which the text would not tell all."""


def key(*things: object) -> str | None:
    """SHA-256 of `things` and of everything else that a result depends on; None if that can't be told.

    Args:
        things: numbers, texts, arrays, containers, and objects of this package or of the libraries made of such.
    """
    things_described, around = described(things), circumstances()
    if things_described is None or around is None:
        return None
    return hashlib.sha256(f"{around}\n{settings()}\n{things_described}".encode()).hexdigest()


def circumstances() -> str | None:
    """The package's code as loaded, Python and the libraries; None where the code has moved since it was loaded."""
    code = source.content()
    return None if code is None else "\n".join([code, platform.python_version(), *_libraries()])


@functools.cache
def _libraries() -> tuple[str, ...]:
    return tuple(f"{name} {version(name)}" for name in LIBRARIES)


def settings() -> str:
    """Settings of JAX and flags of its compiler that change a program or its numbers."""
    c = jax.config
    chosen = (c.jax_enable_x64, c.jax_debug_nans, c.jax_default_matmul_precision, c.jax_numpy_dtype_promotion)
    return repr((chosen, jax.default_backend(), [os.environ.get(name) for name in FLAGS]))


def described(thing: object) -> str | None:
    """`thing` as text that differs whenever anything in it does; None if it holds what can't be told.

    Arrays stand as the hash of their bytes. Order counts, also in mappings.
    """
    try:
        return _text(thing)
    except Untold:
        return None


def _text(x: object) -> str:
    if x is None or isinstance(x, bool | int | str | bytes | float | complex | slice):
        return f"{type(x).__name__} {x!r}" if type(x).__module__ == "builtins" else f"{_name(type(x))} {x!r}"
    if isinstance(x, np.ndarray | np.generic | jax.Array):
        return _array(x)
    if isinstance(x, enum.Enum):
        return f"{_name(type(x))}.{x.name}"
    if isinstance(x, PurePath):
        return f"path {x}"
    if isinstance(x, type):
        return _name(x)
    if dataclasses.is_dataclass(x):
        own = {f.name: getattr(x, f.name) for f in dataclasses.fields(x) if f.compare}
        return f"{_name(type(x))}{_pairs(own)}"
    if isinstance(x, Mapping):
        return f"{'mapping' if type(x) is dict else _name(type(x))}{_pairs(x)}"
    if isinstance(x, tuple | list):
        named = "" if type(x) in (tuple, list) else _name(type(x))
        return f"{named}[{', '.join(map(_text, x))}]"
    if isinstance(x, set | frozenset):
        return f"{{{', '.join(sorted(map(_text, x)))}}}"
    if callable(x) and hasattr(x, "__qualname__"):
        return _name(x)
    raise Untold(type(x))


def _pairs(x: Mapping) -> str:
    return "(" + ", ".join(f"{_text(k)}: {_text(v)}" for k, v in x.items()) + ")"


def _array(x) -> str:
    if isinstance(x, jax.core.Tracer):
        raise Untold("traced")
    x = np.asarray(x)
    if x.dtype == object:
        return f"objects{x.shape}[{', '.join(map(_text, x.ravel().tolist()))}]"
    return f"{x.dtype.str}{x.shape} {hashlib.sha256(np.ascontiguousarray(x).tobytes()).hexdigest()}"


def _name(x) -> str:
    """Where a class or function is defined, if its code is part of the key."""
    module = getattr(x, "__module__", None) or ""
    if "<" in x.__qualname__ or module.partition(".")[0] not in (*KNOWN, "builtins", "types", "collections"):
        raise Untold(f"{module}.{x.__qualname__}")
    return f"{module}.{x.__qualname__}"

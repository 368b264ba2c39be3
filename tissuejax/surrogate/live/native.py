"""The C force asked from Python: 1 to 3 microseconds of C behind some microseconds of call."""

import ctypes
import tempfile
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tissuejax.surrogate.live.compiler import compiled
from tissuejax.surrogate.live.flat import write
from tissuejax.surrogate.surrogate import Surrogate

THREE = ctypes.c_double * 3


class Native:
    """`tick` as in `ask.Asker`, in C; `safe` as a device would be told."""

    def __init__(self, surrogate: Surrogate):
        self.library = ctypes.CDLL(str(compiled("shared.c", shared=True)))
        self.library.tj_open.restype = ctypes.c_void_p
        self.library.tj_fault.restype = ctypes.c_char_p
        self.library.tj_state_size.restype = ctypes.c_size_t
        self.library.tj_force.argtypes = [ctypes.c_void_p, ctypes.c_char_p, THREE, ctypes.c_double, THREE]
        self.library.tj_seconds.restype = ctypes.c_double
        self.library.tj_seconds.argtypes = [ctypes.c_void_p, ctypes.c_long]
        self.library.tj_close.argtypes = [ctypes.c_void_p]
        with tempfile.TemporaryDirectory() as folder:
            path = write(surrogate, Path(folder) / "model.tjf")
            self.model = ctypes.c_void_p(self.library.tj_open(str(path).encode()))
        self.state = ctypes.create_string_buffer(self.library.tj_state_size())
        self.rest()

    def rest(self) -> None:
        """Forget everything."""
        self.library.tj_rest(self.model, self.state)

    def tick(self, p: Float[np.ndarray, "3"], dt: float) -> Float[np.ndarray, "3"]:
        """Force on the ball, N."""
        force = THREE()
        self.library.tj_force(self.model, self.state, THREE(*p), dt, force)
        return np.array(force)

    def seconds(self, count: int = 20_000) -> float:
        """CPU time of one force within C, s."""
        return float(self.library.tj_seconds(self.model, count))

    def __del__(self):
        if getattr(self, "model", None):
            self.library.tj_close(self.model)
            self.model = None

"""Shared by all tests: double precision, the places of outside data, small seeded randomness."""

import os
from pathlib import Path

import jax
import numpy as np
import pytest

jax.config.update("jax_enable_x64", True)

SHARED = Path(os.environ.get("TISSUEJAX_SHARED", Path(__file__).resolve().parents[2] / "shared"))


def outside(*parts: str) -> Path:
    """A file or folder outside the project (reference numbers, recordings); skips, saying so, where absent."""
    path = SHARED.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"{path} is not here: set TISSUEJAX_SHARED to the folder that holds {parts[0]}/")
    return path


@pytest.fixture
def rng():
    return np.random.default_rng(20120)

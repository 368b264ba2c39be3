"""Shared by all tests: double precision, the places of outside data, small seeded randomness."""

import os
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import settings

jax.config.update("jax_enable_x64", True)
# No timed assertions in the suite, and the same examples everywhere.
settings.register_profile("suite", deadline=None, derandomize=True)
settings.load_profile("suite")

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

"""Shared by all tests: double precision, one folder of compiled programs a run, outside data, seeded randomness."""

import gc
import importlib
import os
import shutil
import sys
import tempfile
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import settings
from jaxtyping import install_import_hook

# Shapes and types of the lower floors, checked while their own tests run (`make test`, or TISSUEJAX_SHAPES=on pytest);
# the hook comes before anything of them is imported.
CHECKED = ("tensors", "spectral", "parameters", "energies", "elements", "cohesion")
CHECKED += ("recordings", "estimation", "effects")
if os.environ.get("TISSUEJAX_SHAPES") == "on":
    importlib.import_module("tests.shapes")
    install_import_hook([f"tissuejax.{room}" for room in CHECKED], "tests.shapes.checked")
    sys.meta_path.insert(1, sys.meta_path.pop(0))  # slipcover's stays first: it counts lines of what this one loads

jax.config.update("jax_enable_x64", True)
# No timed assertions in the suite, and the same examples everywhere.
settings.register_profile("suite", deadline=None, derandomize=True)
settings.load_profile("suite")

PROGRAMS = "JAX_COMPILATION_CACHE_DIR"

# Files that take a worker longest, the longest first: begun late, one of them would keep one core alone in the end.
LONGEST = (
    "test_lanes", "test_cli", "test_notebooks", "test_gradients", "test_doors", "test_effects", "test_clock",
    "test_predictor", "test_probing_bench", "test_refusals", "test_fit_small", "test_recordings_real",
    "test_least_squares", "test_at_once", "test_rig_and_memory", "test_rig_faults", "test_relaxation", "test_pressed",
    "test_patch", "test_swallowed", "test_statics", "test_recipe", "test_motion", "test_probing_diagnosis",
    "test_experiments", "test_laws", "test_precompute", "test_blade_run", "test_noise_terms", "test_homogeneous",
    "test_next_probing", "test_force", "test_first",
)  # fmt: skip

SHARED = Path(os.environ.get("TISSUEJAX_SHARED", Path(__file__).resolve().parents[2] / "shared"))


# Folders whose tests compile long and run briefly, and the flag by which `make test` asks for a quick run.
BRIEF, QUICK = ("tled", "probing", "cutting", "surrogate", "contracts", "play"), "--xla_backend_optimization_level"


def pytest_configure(config):
    """What one worker, or a program that a test starts, has compiled in this run the others need not compile again."""
    if PROGRAMS in os.environ or hasattr(config, "workerinput"):
        return
    config.programs = tempfile.mkdtemp(prefix="tissuejax-programs-")
    os.environ |= {PROGRAMS: config.programs, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    jax.config.update("jax_compilation_cache_dir", config.programs)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def pytest_collection_modifyitems(items):
    order = {name: rank for rank, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path.stem, len(order)))


def pytest_collection_finish():
    """Objects of the packages stay, and tracing makes so many more that to look for rings of them every 700 takes a
    tenth of the suite's time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


def pytest_unconfigure(config):
    if hasattr(config, "programs"):
        shutil.rmtree(config.programs, ignore_errors=True)


@pytest.fixture(scope="module", autouse=True)
def no_optimization(request):
    """In a quick run programs of tests that run briefly are compiled without any."""
    brief = request.path.parent.name in BRIEF and QUICK in os.environ.get("XLA_FLAGS", "")
    jax.config.update("jax_disable_most_optimizations", brief)
    yield
    jax.config.update("jax_disable_most_optimizations", False)


def outside(*parts: str) -> Path:
    """A file or folder outside the project (reference numbers, recordings); skips, saying so, where absent."""
    path = SHARED.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"{path} is not here: set TISSUEJAX_SHARED to the folder that holds {parts[0]}/")
    return path


@pytest.fixture
def rng():
    return np.random.default_rng(20120)

"""Programs kept on disk: found without tracing, by all that they depend on, and traced anew wherever that fails."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax import cache
from tissuejax.cache import Kept
from tissuejax.diagnosis.material import told
from tissuejax.effects.drift import Drift
from tissuejax.energies.catalogue import energy
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.model import Model


@pytest.fixture
def kept_in(tmp_path):
    """A folder of kept programs for one test."""
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path / cache.TRACED
    jax.config.update("jax_compilation_cache_dir", before)


class Counted:
    """x -> sin(factor * a) + b, and how often it was traced."""

    def __init__(self, factor: float = 2.0):
        self.factor, self.traced = factor, 0

    def __call__(self, a, both):
        self.traced += 1
        return jnp.sin(self.factor * a) + both["b"]


A, B = np.linspace(0.0, 1.0, 7), {"b": np.full(7, 0.25)}


def test_found_without_tracing_to_the_last_bit(kept_in):
    first, second = Counted(), Counted()
    value = np.asarray(Kept(first, "twice")(A, B))
    again = np.asarray(Kept(second, "twice")(A, B))
    assert (first.traced, second.traced) == (1, 0)
    assert np.array_equal(value, again)
    assert np.allclose(value, np.sin(2 * A) + 0.25, atol=1e-15)


def test_another_text_or_shape_is_another_program(kept_in):
    Kept(Counted(), "twice")(A, B)
    other, longer = Counted(3.0), Counted()
    assert np.allclose(Kept(other, "thrice")(A, B), np.sin(3 * A) + 0.25, atol=1e-15)
    assert Kept(longer, "twice")(np.zeros(9), {"b": np.ones(9)}).shape == (9,)
    assert (other.traced, longer.traced) == (1, 1)
    assert len(list(kept_in.iterdir())) == 3


def test_one_trace_a_process_however_often_it_is_called(kept_in):
    counted = Counted()
    kept = Kept(counted, None)
    for scale in (1.0, 2.0, 3.0):
        assert np.allclose(kept(scale * A, B), np.sin(2 * scale * A) + 0.25, atol=1e-15)
    assert counted.traced == 1
    assert not kept_in.exists()  # nothing said of what it depends on: not kept on disk


@pytest.mark.parametrize("content", [b"", b"cut off", "half"])
def test_a_broken_file_is_made_again(kept_in, content):
    Kept(Counted(), "twice")(A, B)
    (path,) = kept_in.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if content == "half" else content)
    second, third = Counted(), Counted()
    assert np.allclose(Kept(second, "twice")(A, B), np.sin(2 * A) + 0.25, atol=1e-15)
    Kept(third, "twice")(A, B)
    assert (second.traced, third.traced) == (1, 0)


def test_the_package_s_source_and_the_settings_are_part_of_the_name(kept_in, monkeypatch):
    Kept(Counted(), "twice")(A, B)
    monkeypatch.setattr(cache, "_circumstances", lambda: "another version")
    changed = Counted()
    Kept(changed, "twice")(A, B)
    with jax.default_matmul_precision("float32"):
        precise = Counted()
        Kept(precise, "twice")(A, B)
    assert (changed.traced, precise.traced) == (1, 1)


def test_the_oldest_go_when_there_are_too_many(kept_in, monkeypatch):
    monkeypatch.setattr(cache, "MOST", 2)
    for n in range(4):
        Kept(Counted(float(n)), f"times {n}")(A, B)
    assert len(list(kept_in.iterdir())) == 2


def test_a_program_that_calls_back_runs_and_is_not_kept(kept_in):
    def calls_back(a):
        return jax.pure_callback(np.cos, jax.ShapeDtypeStruct(a.shape, a.dtype), a)

    assert np.allclose(Kept(calls_back, "calls back")(A), np.cos(A), atol=1e-15)
    assert np.allclose(Kept(calls_back, "calls back")(A), np.cos(A), atol=1e-15)
    assert not kept_in.exists()


def test_a_model_s_text_holds_its_laws_and_their_numbers():
    one = told(Model(energy("yeoh", None), None, (Drift(separate=True),)))
    assert one == told(Model(energy("yeoh", None), None, (Drift(separate=True),)))
    others = [
        told(Model(energy("yeoh", None), None, (Drift(separate=False),))),
        told(Model(energy("neo-hookean", None), None, (Drift(separate=True),))),
        told(Model(energy("yeoh", None))),
    ]
    assert None not in others
    assert len({one, *others}) == 4


def test_nothing_is_told_of_a_law_from_elsewhere():
    class Mine(NeoHookean):
        pass

    assert told(Model(Mine())) is None

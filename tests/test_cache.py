"""Programs kept on disk: found without tracing, by all that they depend on, and traced anew wherever that fails."""

import os
import shutil
import subprocess
import sys
from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.cache import key, programs, source
from tissuejax.cache.key import described
from tissuejax.cache.programs import Kept
from tissuejax.diagnosis.material import MaterialBench
from tissuejax.effects.drift import Drift
from tissuejax.energies.catalogue import energy
from tissuejax.energies.fibre import WithFibre
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.errors import InputError
from tissuejax.estimation.series import Segment
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.surrogate.live import compiler


@pytest.fixture
def kept_in(tmp_path):
    """A folder of kept programs for one test."""
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path / programs.TRACED
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


def test_what_is_compiled_ahead_is_traced_once_and_is_what_is_called(kept_in):
    counted, other = Counted(), Counted()
    program, never = Kept(counted, "ahead"), Kept(other, "never called")
    with programs.ahead([(program, (A, B)), (never, (A[:3], {"b": A[:3]}))]):
        value = np.asarray(program(A, B))
    assert counted.traced == 1
    assert np.allclose(value, np.sin(2 * A) + 0.25, atol=1e-15)
    assert np.allclose(np.asarray(never(A[:3], {"b": A[:3]})), np.sin(2 * A[:3]) + A[:3], atol=1e-15)
    assert other.traced == 1  # whether it was begun ahead or not


def test_what_fails_ahead_fails_where_it_is_called_and_may_succeed_later(kept_in):
    broken = [True]

    def fails(a):
        if broken:
            raise ZeroDivisionError("no such law")
        return 2 * a

    program = Kept(fails, None)
    with programs.ahead([(program, (A,))]):
        with pytest.raises(ZeroDivisionError, match="no such law"):
            program(A)
        broken.clear()
        assert np.array_equal(np.asarray(program(A)), 2 * A)


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
    with monkeypatch.context() as patched:
        patched.setattr(source, "LOADED", "another version")
        changed = Counted()
        Kept(changed, "twice")(A, B)
    with jax.default_matmul_precision("float32"):
        precise = Counted()
        Kept(precise, "twice")(A, B)
    single = Counted()
    jax.config.update("jax_enable_x64", False)
    try:
        assert Kept(single, "twice")(A, B).dtype == np.float32
    finally:
        jax.config.update("jax_enable_x64", True)
    with monkeypatch.context() as patched:
        patched.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=true")
        fast = Counted()
        Kept(fast, "twice")(A, B)
    again = Counted()
    assert Kept(again, "twice")(A, B).dtype == np.float64
    assert [c.traced for c in (changed, precise, single, fast, again)] == [1, 1, 1, 1, 0]


def copied(to):
    """The package alone in another folder."""
    shutil.copytree(source.ROOT, to / "tissuejax", ignore=shutil.ignore_patterns("__pycache__"))
    return to / "tissuejax"


def test_the_hash_is_of_names_and_contents(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n")
    (tmp_path / "b.py").write_text("y = 2\n")
    seen = {source.hashed(tmp_path)}
    (tmp_path / "a.py").write_text("x = 3\n")
    seen.add(source.hashed(tmp_path))
    (tmp_path / "a.py").rename(tmp_path / "c.py")
    seen.add(source.hashed(tmp_path))
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "c.pyc").write_bytes(b"compiled")
    assert source.hashed(tmp_path) in seen
    assert len(seen) == 3


def test_an_edit_that_is_taken_back_counts_as_one(tmp_path):
    file = tmp_path / "a.py"
    file.write_text("x = 1\n")
    before, written = source.marks(tmp_path), file.stat()
    file.write_text("x = 3\n")
    file.write_text("x = 1\n")
    os.utime(file, ns=(written.st_atime_ns, written.st_mtime_ns))
    assert source.marks(tmp_path) != before


def test_what_is_loaded_after_an_edit_has_no_key(monkeypatch):
    """Modules that were loaded before stay what they are; one that comes later may be of either version."""
    assert key.key(1) == key.key(1)
    assert key.key(1) is not None
    monkeypatch.setattr(source, "_AT_IMPORT", {**source.marks(), "energies/new.py": (1, 1, 1)})
    assert source.moved() == ["energies/new.py"]
    assert key.key(1) is not None
    monkeypatch.setitem(sys.modules, "tissuejax.energies.new", ModuleType("tissuejax.energies.new"))
    assert key.key(1) is None
    counted = Counted()
    assert np.allclose(Kept(counted, "moved")(A, B), np.sin(2 * A) + 0.25, atol=1e-15)


LIVE = """
import sys
from pathlib import Path

import jax, numpy as np

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_compilation_cache_dir", sys.argv[2])
import tissuejax

file = Path(sys.argv[1]) / "energies" / "neo_hookean.py"
if sys.argv[3] == "before loading":
    file.write_text(file.read_text().replace("0.25", "0.5"))
from tissuejax.diagnosis.material import compiled
from tissuejax.energies.catalogue import energy
from tissuejax.experiments.catalogue import experiment
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording

law = energy("neo-hookean", None)
if sys.argv[3] == "after loading":
    file.write_text(file.read_text().replace("0.5", "0.25"))
time = np.arange(3.0)
inputs = {"time": time, "stretch": np.array([1.0, 1.1, 1.2])}
pulled = Recording("r", "uniaxial", inputs, {"nominal_stress": Channel(time, 0 * time, "Pa", 1.0)})
test = experiment("uniaxial").test(pulled)
print(float(compiled(Model(law))(np.array([1000.0]), test)[1]))
"""
PULLED = 1000 * (1.1 - 1.1**-2)  # Pa, of mu/2 (I1 - 3)


def test_an_edit_while_a_process_lives_is_never_served_to_the_next(tmp_path):
    """As a user does: import, edit a formula, compute; then a new process with the new formula, cache on."""
    package = copied(tmp_path)

    def stress(edit: str) -> float:
        script = [sys.executable, "-c", LIVE, str(package), str(tmp_path / "kept"), edit]
        environment = os.environ | {"PYTHONPATH": str(tmp_path), "JAX_PLATFORMS": "cpu"}
        done = subprocess.run(script, capture_output=True, text=True, env=environment, cwd=tmp_path, check=False)
        assert done.returncode == 0, done.stderr[-2000:]
        return float(done.stdout)

    assert stress("after loading") == pytest.approx(PULLED), "what is loaded stays"
    assert stress("before loading") == pytest.approx(PULLED), "what is in the file at that time is loaded"
    file = package / "energies" / "neo_hookean.py"
    file.write_text(file.read_text().replace("0.5", "0.25"))
    assert stress("no") == pytest.approx(0.5 * PULLED), "a stale program was served"


def test_the_oldest_go_when_there_are_too_many(kept_in, monkeypatch):
    monkeypatch.setattr(programs, "MOST", 2)
    for n in range(4):
        Kept(Counted(float(n)), f"times {n}")(A, B)
    assert len(list(kept_in.iterdir())) == 2


def test_a_program_that_calls_back_runs_and_is_not_kept(kept_in):
    def calls_back(a):
        return jax.pure_callback(np.cos, jax.ShapeDtypeStruct(a.shape, a.dtype), a)

    assert np.allclose(Kept(calls_back, "calls back")(A), np.cos(A), atol=1e-15)
    assert np.allclose(Kept(calls_back, "calls back")(A), np.cos(A), atol=1e-15)
    assert not kept_in.exists()


def test_every_prediction_of_a_material_test_can_be_kept():
    """One that calls back into Python has no form on disk, and every process would compile it anew."""
    time, stretch = np.arange(40.0), 1 + 0.005 * np.arange(40)
    stress = Channel(time, 1000 * (stretch - 1), "Pa", 2.0)
    recording = Recording("r1", "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": stress}, {})
    bench = MaterialBench.of(Sample("s", {"r1": recording}), energy("neo-hookean"), ("r1",), (), {"r1": 2.0})
    fibred = next(c.paths for c in bench.candidates.values() if c.name == "anisotropy")
    both = (*bench.candidates["compressibility"].paths, *fibred)
    tried = [*(c.paths for c in bench.candidates.values()), both]
    built = {id(p): p for p in (bench._program(dict.fromkeys((*bench.base, *paths), 0.0)) for paths in tried)}
    assert len(built) > 6
    for program in built.values():
        leaves, tree = jax.tree.flatten((program.places["r1"][0], bench._tests["r1"]))
        flat = jax.jit(lambda *x, p=program, tree=tree: p.run._function(*jax.tree.unflatten(tree, x)))
        assert jax.export.export(flat)(*leaves).serialize()


def test_a_model_s_text_holds_its_laws_and_their_numbers():
    one = described(Model(energy("yeoh", None), None, (Drift(separate=True),)))
    assert one == described(Model(energy("yeoh", None), None, (Drift(separate=True),)))
    others = [
        described(Model(energy("yeoh", None), None, (Drift(separate=False),))),
        described(Model(energy("neo-hookean", None), None, (Drift(separate=True),))),
        described(Model(energy("yeoh", None))),
    ]
    assert None not in others
    assert len({one, *others}) == 4


class Mine(NeoHookean):
    """A law from a user's script: its formula is not part of any key."""


@pytest.mark.parametrize(
    "law", [Mine(), WithFibre(Mine()), WithFibre(WithFibre(Mine()))], ids=["bare", "wrapped", "twice"]
)
def test_nothing_is_told_of_a_law_from_elsewhere_however_deep_it_lies(kept_in, law):
    assert described(Model(law)) is None
    assert described({"laws": [law]}) is None
    assert key.key(Model(law)) is None
    assert described(Model(WithFibre(NeoHookean()))) is not None


def test_functions_of_a_script_tell_nothing():
    assert described(lambda x: x) is None
    assert described(copied) is None
    assert described(jnp.sin) is None or "sin" in described(jnp.sin)


def test_every_number_of_an_input_counts():
    def segment(last: float, rows: int = 2000) -> Segment:
        time = np.arange(2000.0)
        time[1000] += last  # in the middle, which the text of a long array leaves out
        return Segment("r", "c", "", slice(0, rows), time, "Pa", np.zeros(2000))

    assert described(segment(0.0)) == described(segment(0.0))
    assert described(segment(0.0)) != described(segment(1e-12))
    assert described(segment(0.0)) != described(segment(0.0, 1999))
    single, double = np.zeros(2, np.float32), np.zeros(1, np.float64)
    assert described(single) != described(double), "the same bytes"
    assert described(1) != described(1.0)
    assert described(1) != described(True)
    assert described((1, 2)) != described((2, 1))
    assert described({"a": (1,), "b": ()}) != described({"a": (), "b": (1,)})


def test_a_folder_that_others_may_write_is_refused(kept_in, tmp_path):
    tmp_path.chmod(0o775)
    with pytest.warns(UserWarning, match="may be written by others"):
        Kept(Counted(), "twice")(A, B)
    assert not kept_in.exists()


def test_a_folder_of_another_user_is_refused(kept_in, monkeypatch):
    monkeypatch.setattr(os, "getuid", lambda: 4711)
    with pytest.warns(UserWarning, match="belongs to another user"):
        Kept(Counted(), "twice")(A, B)
    assert not kept_in.exists()


def test_no_program_is_run_from_a_folder_that_others_may_write(tmp_path, monkeypatch):
    monkeypatch.setenv(programs.ENVIRONMENT, str(tmp_path))
    (tmp_path / "compiled").mkdir()
    (tmp_path / "compiled").chmod(0o777)
    with pytest.raises(InputError, match="compiled may be written by others"):
        compiler.compiled("loop.c")
    assert not list((tmp_path / "compiled").iterdir())


def test_a_folder_is_made_for_its_user_alone(tmp_path, monkeypatch):
    monkeypatch.setenv(programs.ENVIRONMENT, str(tmp_path / "mine"))
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", None)
    try:
        programs.keep_programs()
        assert jax.config.jax_compilation_cache_dir == str(tmp_path / "mine")
        assert (tmp_path / "mine").stat().st_mode & 0o777 == 0o700
    finally:
        jax.config.update("jax_compilation_cache_dir", before)

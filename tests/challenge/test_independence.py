"""The challenge measures the diagnosis and shares nothing with it: read from its imports."""

import ast
from pathlib import Path

import tissuejax.challenge as room

FOLDER = Path(room.__file__).parent
TOOLS = {"errors", "storage", "progress", "parent", "challenge"}  # messages, files, processes: no physics, no numbers
# they call the diagnosis from outside, as a user would, and ask the model that it found for a prediction
RUNNERS = {"run.py": {"diagnosis"}, "kept.py": {"diagnosis", "energies", "recordings"}}


def rooms(path: Path) -> set[str]:
    """Rooms of the package that a file imports, wherever in the file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: relative import"
            names = [f"{node.module}.{a.name}" for a in node.names]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
            "import_module",
            "__import__",
            "run_path",
        ):
            names = [a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        found |= {n.split(".")[1] for n in names if n.startswith("tissuejax.")}
    return found


def test_the_challenge_imports_nothing_of_what_it_measures():
    files = sorted(FOLDER.rglob("*.py"))
    assert len(files) > 20
    for path in files:
        extra = RUNNERS.get(path.name, set())
        assert rooms(path) <= TOOLS | extra, f"{path.name} imports {rooms(path) - TOOLS - extra}"


def test_jax_is_met_in_the_runner_alone():
    for path in FOLDER.rglob("*.py"):
        text = path.read_text()
        assert path.name in RUNNERS or "import jax\n" not in text, path.name


def test_an_import_of_physics_would_be_seen(tmp_path):
    spy = tmp_path / "spy.py"
    spy.write_text("def f():\n    from tissuejax.effects.catalogue import effects\n    return effects\n")
    assert rooms(spy) == {"effects"}

"""Hook of the documentation site: an API page for every room of the package, found by walking it."""

from pathlib import Path

from mkdocs.structure.files import File, Files

PACKAGE = Path(__file__).parent.parent / "tissuejax"
LEFT_OUT = {"commands", "cli", "__init__", "__main__"}  # the command line explains itself


def rooms() -> list[str]:
    """Names of the folders and files of the package, in the order of the alphabet."""
    folders = {p.parent.name for p in PACKAGE.glob("*/__init__.py")}
    return sorted((folders | {p.stem for p in PACKAGE.glob("*.py")}) - LEFT_OUT)


def on_config(config):
    """Put the API pages behind the pages that `mkdocs.yml` lists in reading order."""
    config.nav = [*config.nav, {"API": [f"api/{room}.md" for room in rooms()]}]
    return config


def on_files(files: Files, config) -> Files:
    """Add `api/ROOM.md` for each room."""
    for room in rooms():
        text = f"# `tissuejax.{room}`\n\n::: tissuejax.{room}\n"
        files.append(File.generated(config, f"api/{room}.md", content=text))
    return files

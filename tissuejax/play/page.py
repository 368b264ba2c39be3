"""The page: one HTML file, alone with its model inside or empty for a server to fill."""

import json
from importlib.resources import files
from pathlib import Path

from tissuejax.storage import plain, write_text

SLOT = "/*MODEL*/null"


def served() -> str:
    """The page that asks its server."""
    return files("tissuejax.play").joinpath("page.html").read_text()


def alone(model: dict) -> str:
    """The page with the model inside: it needs no server and no network."""
    payload = json.dumps(plain(model)).replace("</", "<\\/")
    return served().replace(SLOT, payload)


def export(model: dict, path: str | Path) -> Path:
    """Write the page with the model inside."""
    return write_text(path, alone(model))

"""Families found by walking their folder: adding a member is adding a file, no list is kept by hand."""

import importlib
import inspect
import pkgutil
from functools import cache
from types import ModuleType
from typing import Any

from tissuejax.errors import unknown


def members(package: ModuleType, kind: type) -> dict[str, type]:
    """All final subclasses of `kind` defined in the modules of `package`, by their `name`.

    Args:
        package: the folder to walk, one member a file.
        kind: the abstract class that members derive from; a member declares `name`.

    Raises:
        RuntimeError: two members share one name.
    """
    return dict(_walked(package, tuple(package.__path__), kind))


@cache  # a walk takes longer than a small fit
def _walked(package: ModuleType, folders: tuple[str, ...], kind: type) -> dict[str, type]:
    found: dict[str, Any] = {}
    for info in sorted(pkgutil.iter_modules(folders), key=lambda i: i.name):
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        declared: list[tuple[str, Any]] = inspect.getmembers(module, inspect.isclass)
        for _, member in declared:
            if member.__module__ != module.__name__ or not issubclass(member, kind) or inspect.isabstract(member):
                continue
            if not hasattr(member, "name"):  # shared by some members, itself none
                continue
            if member.name in found:
                raise RuntimeError(f"two members named {member.name!r}: {found[member.name]} and {member}")
            found[member.name] = member
    return found


def lookup(kind: str, name: str, found: dict[str, type]) -> type:
    """The member called `name`, or an error that offers the nearest names."""
    if name not in found:
        raise unknown(kind, name, found)
    return found[name]

"""Finds the members of a family: each file or folder of a package is one, and states its own facts.

Effects, commands, formats, optimisers, kinds of campaigns, verbs, report sections and tabs are found so; adding one
is adding a file.
"""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType
from typing import Any, TypeVar

Base = TypeVar("Base")


def names(package: str, *, files: bool = True, folders: bool = True) -> list[str]:
    """The files and folders of a package, in alphabetical order; none of them is imported."""
    found = pkgutil.iter_modules(importlib.import_module(package).__path__)
    return sorted(one.name for one in found if (folders if one.ispkg else files))


def members(package: str, fact: str, *, files: bool = True, folders: bool = False) -> dict[str, Any]:
    """What the files or folders of a package state under this name, by theirs; those without it are no members."""
    wanted = names(package, files=files, folders=folders)
    modules = {name: importlib.import_module(f"{package}.{name}") for name in wanted}
    return {name: getattr(module, fact) for name, module in modules.items() if hasattr(module, fact)}


def classes(package: str, base: type[Base]) -> list[type[Base]]:
    """The concrete classes of a kind that the files of a package define."""
    modules = [importlib.import_module(f"{package}.{name}") for name in names(package, folders=False)]
    return [one for module in modules for one in classes_in(module, base)]


def classes_in(module: ModuleType, base: type[Base]) -> list[type[Base]]:
    """The concrete classes of a kind that one file defines; what it imports is another's."""
    return [
        one
        for one in vars(module).values()
        if isinstance(one, type)
        and issubclass(one, base)
        and one.__module__ == module.__name__
        and not getattr(one, "__abstractmethods__", None)
    ]

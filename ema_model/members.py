"""Finds the members of a family: each file of a package is one, and states its own facts.

Effects, commands, formats, optimisers, verbs and tabs are found so; adding one is adding a file.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

Base = TypeVar("Base")


def names(package: str) -> list[str]:
    """The files of a package, in alphabetical order; neither they nor the package are imported."""
    return sorted(one.name for one in pkgutil.iter_modules(map(str, _places(package))) if not one.ispkg)


def stated(package: str, fact: str) -> dict[str, Any]:
    """The literal that each file of a package assigns to this name, in the file or in its class, by the file's name.

    The sources are read and nothing is imported, for whoever only lists names and must answer at once.  A value that is
    no literal is `...`; files that do not assign the name are left out.
    """
    found = {}
    for path in sorted(path for place in _places(package) for path in place.glob("[!_]*.py")):
        if fact in (source := _source(path)) and (values := list(_assigned(_parsed(source), fact))):
            found[path.stem] = values[0]
    return found


def stated_by_class(package: str, fact: str) -> dict[str, Any]:
    """The literals that the classes of a package's files assign to this name, by the classes' names."""
    return {
        node.name: value
        for place in _places(package)
        for path in sorted(place.glob("[!_]*.py"))
        for node in _parsed(_source(path)).body
        if isinstance(node, ast.ClassDef)
        for value in _assigned(node, fact)
    }


def stated_in(module: str, fact: str) -> Any:
    """The same of one file: the literal that it assigns to this name."""
    package, _, name = module.rpartition(".")
    (path,) = (place / f"{name}.py" for place in _places(package))
    return next(_assigned(_parsed(_source(path)), fact))


def _places(package: str) -> list[Path]:
    top, *folders = package.split(".")
    # Only the top is imported, which holds nothing: a package below may take a second.
    return [Path(place, *folders) for place in importlib.import_module(top).__path__]


def _source(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@lru_cache(maxsize=8)  # several facts of a file are asked for one after another
def _parsed(source: str) -> ast.Module:
    return ast.parse(source)


def _assigned(body: ast.Module | ast.ClassDef, fact: str) -> Iterator[Any]:
    for node in body.body:
        if isinstance(node, ast.ClassDef):
            yield from _assigned(node, fact)
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(isinstance(target, ast.Name) and target.id == fact for target in targets):
                try:
                    yield ast.literal_eval(node.value)
                except ValueError:
                    yield ...


def members(package: str, fact: str) -> dict[str, Any]:
    """What the files of a package state under this name, by theirs; those without it are no members."""
    modules = {name: importlib.import_module(f"{package}.{name}") for name in names(package)}
    return {name: getattr(module, fact) for name, module in modules.items() if hasattr(module, fact)}


def classes(package: str, base: type[Base]) -> list[type[Base]]:
    """The concrete classes of a kind that the files of a package define."""
    modules = [importlib.import_module(f"{package}.{name}") for name in names(package)]
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

"""Metaheuristic optimisers, one a file: a new module here with an `Optimiser` subclass is found by itself."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from typing import Any

from ema_model.identification.optimisers.base import Optimiser


def _find() -> dict[str, type[Optimiser]]:
    """Concrete optimisers defined in this folder's modules, by name."""
    found: dict[str, type[Optimiser]] = {}
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        for member in vars(module).values():
            if not (inspect.isclass(member) and issubclass(member, Optimiser)) or inspect.isabstract(member):
                continue
            if member.__module__ != module.__name__:  # imported from a sibling, not defined here
                continue
            if member.name in found:
                raise ImportError(f"two optimisers are named {member.name!r}: {found[member.name]} and {member}")
            found[member.name] = member
    return found


OPTIMISERS: dict[str, type[Optimiser]] = _find()


def create(name: str, **kw: Any) -> Optimiser:
    """The optimiser called `name`; `kw` are its arguments (dimension, population, iterations, seed, settings)."""
    if name not in OPTIMISERS:
        raise ValueError(f"unknown optimiser {name!r}; known: {', '.join(sorted(OPTIMISERS))}")
    return OPTIMISERS[name](**kw)


__all__ = ["OPTIMISERS", "Optimiser", "create"]

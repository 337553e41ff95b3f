"""Metaheuristic optimisers: an `Optimiser` subclass in a module of this folder is found by itself."""

from __future__ import annotations

from typing import Any

from ema_model.identification.optimisers.base import Optimiser
from ema_model.members import classes

OPTIMISERS: dict[str, type[Optimiser]] = {one.name: one for one in classes(__name__, Optimiser)}


def create(name: str, **kw: Any) -> Optimiser:
    """The optimiser called `name`; `kw` are its arguments (dimension, population, iterations, seed, settings)."""
    if name not in OPTIMISERS:
        raise ValueError(f"unknown optimiser {name!r}; known: {', '.join(sorted(OPTIMISERS))}")
    return OPTIMISERS[name](**kw)


__all__ = ["OPTIMISERS", "Optimiser", "create"]

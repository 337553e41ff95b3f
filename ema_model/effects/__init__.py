"""The catalogue of effects: each other file of this folder is one, under its file's name.

To add an effect, add a file with an `EFFECT`: the models, the command line, the app and the tests find it.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import replace

from ema_model.effects.effect import Effect, Parameter
from ema_model.errors import InputError

__all__ = ["CATALOGUE", "Effect", "Parameter", "find"]

CATALOGUE: dict[str, Effect] = {
    module.name: replace(importlib.import_module(f"{__name__}.{module.name}").EFFECT, name=module.name)
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name)
    if module.name != "effect"
}


def find(name: str) -> Effect:
    """The effect of that name; InputError lists the names there are."""
    try:
        return CATALOGUE[name]
    except KeyError:
        raise InputError(f"no effect {name!r}; effects are {', '.join(CATALOGUE)}") from None

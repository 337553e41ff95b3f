"""The catalogue of effects: each other file of this folder is one, under its file's name.

To add an effect, add a file with an `EFFECT`: the models, the command line, the app and the tests find it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from ema_model.effects.effect import Effect, Parameter
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.members import members
from ema_model.quantities import MOTOR, NEITHER, ROTARY, USER, Axes

__all__ = ["CATALOGUE", "MOTOR", "NEITHER", "USER", "Effect", "Parameter", "catalogue_name", "find", "register"]

AnyEffect = TypeVar("AnyEffect", bound=Effect)

CATALOGUE: dict[str, Effect] = {
    name: replace(effect, name=name) for name, effect in members(__name__, "EFFECT").items()
}
_OF_THE_USER: dict[str, Effect] = {}  # made at run time by `ema_model.effects.user`; not part of the catalogue


def find(name: str, axes: Axes = ROTARY) -> Effect:
    """The effect of that name, of the catalogue or registered, on these axes; InputError names one like it.

    A model may hold an effect several times, as cogging at several orders: the second is `cogging_torque_2`.
    """
    effect = CATALOGUE.get(name) or _OF_THE_USER.get(name)
    if effect is None:
        again = CATALOGUE.get(catalogue_name(name))
        if again is None:
            like = did_you_mean(name, CATALOGUE) or f"; `emaviz effects` lists the {len(CATALOGUE)}"
            raise InputError(f"no effect {quoted(name)!r}{like}")
        effect = replace(again, name=name)
    return effect.on(axes)


def catalogue_name(name: str) -> str:
    """The catalogue's name of an effect that a model may hold several times."""
    kind, _, number = name.rpartition("_")
    return kind if number.isdecimal() and int(number) > 1 and kind in CATALOGUE else name


def register(effect: AnyEffect) -> AnyEffect:
    """Lets `find`, and so every model of this process, know a user's effect under its name."""
    if effect.name in CATALOGUE:
        raise InputError(f"effect {effect.name} is part of the catalogue; give the user's effect another name")
    _OF_THE_USER[effect.name] = effect
    return effect

"""What a session's file holds of Compare: the recordings, and what is asked of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from emaviz.session.actuators import UPLOADED
from emaviz.session.compare.comparing import Comparing
from emaviz.session.described import taken
from emaviz.session.saved import Part


class Asked(msgspec.Struct, frozen=True):
    """As it is saved."""

    files: tuple[str, ...]  # names in the data folder
    actuator: str
    calibrate: bool
    free: frozenset[str]  # parameters that a calibration may move, by path
    weights: dict[str, float]  # of the signals to fit
    window_s: tuple[float, float] | None = None


def kept(comparing: Comparing, shown: Callable[[], None]) -> Part:
    """shown(): called when what is asked was restored, before the recordings are opened."""

    def save() -> dict[str, Any]:
        own = comparing
        asked = Asked(
            tuple(own.opened), own.actuator_name, own.calibrate, frozenset(own.free), own.weights, own.window_s
        )
        return msgspec.to_builtins(asked, order="sorted")

    def restore(saved: Any, names: Mapping[str, str]) -> None:
        asked: Asked = taken(Asked, saved, "part of Compare")
        actuator = asked.actuator
        if actuator.startswith(UPLOADED):
            name = actuator.removeprefix(UPLOADED)
            actuator = UPLOADED + names.get(name, name)
        comparing.choose_actuator(actuator)
        comparing.calibrate = asked.calibrate
        for path in comparing.actuator.tolerances:
            comparing.set_free(path, path in asked.free)
        comparing.weights = {}
        for name, weight in asked.weights.items():
            comparing.set_weight(name, weight)
        comparing.window_s = None
        if asked.window_s is not None:
            comparing.set_window(*asked.window_s)
        files = [names.get(name, name) for name in asked.files]
        comparing.comparison = None  # of what was there before
        comparing.provenance.clear()
        shown()
        for name in [name for name in comparing.opened if name not in files]:
            comparing.remove(name)
        for name in files:
            comparing.add(name)

    return Part(save, restore)

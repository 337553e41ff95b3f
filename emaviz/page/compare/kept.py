"""What a session's file holds of Compare: the recordings, and what is asked of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ema_model.errors import InputError
from emaviz.session.actuators import UPLOADED
from emaviz.session.compare.comparing import Comparing
from emaviz.session.saved import Part


def kept(comparing: Comparing, shown: Callable[[], None]) -> Part:
    """shown(): called when what is asked was restored, before the recordings are opened."""

    def save() -> dict[str, Any]:
        return {
            "files": list(comparing.opened),
            "actuator": comparing.actuator_name,
            "calibrate": comparing.calibrate,
            "free": sorted(comparing.free),
            "weights": comparing.weights,
            "window_s": comparing.window_s,
        }

    def restore(saved: Any, names: Mapping[str, str]) -> None:
        try:
            actuator = str(saved["actuator"])
            if actuator.startswith(UPLOADED):
                name = actuator.removeprefix(UPLOADED)
                actuator = UPLOADED + names.get(name, name)
            comparing.choose_actuator(actuator)
            comparing.calibrate = bool(saved["calibrate"])
            for path in comparing.actuator.tolerances:
                comparing.set_free(path, path in saved["free"])
            comparing.weights = {}
            for name, weight in saved["weights"].items():
                comparing.set_weight(str(name), weight)
            comparing.window_s = None
            if saved["window_s"] is not None:
                comparing.set_window(*saved["window_s"])
            files = [names.get(str(name), str(name)) for name in saved["files"]]
        except (KeyError, TypeError, AttributeError):
            raise InputError("the session's part of Compare is damaged; save it anew") from None
        shown()
        for name in [name for name in comparing.opened if name not in files]:
            comparing.remove(name)
        for name in files:
            comparing.add(name)

    return Part(save, restore)

"""The electromechanical actuator's models, without a screen.

    import ema_model as em
    recording = em.simulate("chirp", faults={"k1": 0.25}, noise_A=0.1)
    print(em.identify(recording))

`api` says what each takes; what is below stands in the folders.  Nothing is loaded before it is asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ema_model.api import (
        InputError,
        analyse,
        compare,
        compare_units,
        discover,
        export,
        health,
        identify,
        load_actuator,
        read,
        save_actuator,
        simulate,
        track,
    )

__all__ = [
    "InputError",
    "analyse",
    "compare",
    "compare_units",
    "discover",
    "export",
    "health",
    "identify",
    "load_actuator",
    "read",
    "save_actuator",
    "simulate",
    "track",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from ema_model import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

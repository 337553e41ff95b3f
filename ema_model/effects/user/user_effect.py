"""An effect that a user made, and what is written of it beside its parameters."""

from __future__ import annotations

from dataclasses import dataclass, field

from ema_model.effects import Effect


@dataclass(frozen=True)
class UserEffect(Effect):
    """An effect that is no file of the catalogue; `entries` reads and writes its table in actuator files.

    Its name ends in a hash of its kernels; what differs in its parameters' values alone has the same name.
    """

    kind: str = ""  # "user_torque" or "torque_curve"
    definition: dict[str, str | float] = field(default_factory=dict, hash=False)  # makes its kernels again

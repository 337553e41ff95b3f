"""Rotary and linear axes: the equations are the same, the names and the units are not.

Inside, every quantity has its rotary name; an angle of a linear axis is a length in m, a torque a force in N, an
inertia a mass in kg.  Files and people see the axis's own names.  Motor and user may differ: a ball screw turns
in the motor's rad and moves in the user's m, and its gear ratio is in m/rad.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ema_model.quantities.si import linear_name, linear_unit
from ema_model.quantities.sides import MOTOR, USER, Side
from ema_model.quantities.signals import SIGNALS

KINDS = ("rotary", "linear")


@dataclass(frozen=True)
class Axes:
    """The kind of the motor's and of the user's axis: "rotary" or "linear"."""

    motor: str = "rotary"
    user: str = "rotary"

    def is_linear(self, side: Side | None) -> bool:
        """Whether what sits at that side is a length and not an angle; what has no side never is."""
        return (side == MOTOR and self.motor == "linear") or (side == USER and self.user == "linear")

    def name(self, name: str, side: Side | None) -> str:
        """The name in files of what is `name` inside: inertia_kgm2 or mass_kg."""
        return linear_name(name) if self.is_linear(side) else name

    def unit(self, unit: str, side: Side | None, per: Side | None = None) -> str:
        """The unit, as shown, of what has `unit` on rotary axes.

        per: the side whose angle stands below the line of what rotary axes leave out as rad/rad: of a gear ratio, the
        user's angle per motor's; of an order, periods per turn.
        """
        if per is None:
            return linear_unit(unit) if self.is_linear(side) else unit
        above, below = ("m" if self.is_linear(one) else "rad" for one in (side, per))
        if above == below:
            return unit
        return f"{above}/{below}" if not unit else unit.replace("1/", f"{above}/({below}·") + ")"

    def signal(self, name: str) -> str:
        """The name in recordings of the signal that is `name` inside."""
        signal = SIGNALS.get(name)
        return name if signal is None else self.name(name, signal.side)

    def inside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by their names inside; those of the other kind of axis are left out."""
        names = {self.signal(name): name for name in ROTARY_SIGNALS}
        foreign = {linear_name(name) for name in ROTARY_SIGNALS} | ROTARY_SIGNALS
        return {
            names.get(name, name): values for name, values in signals.items() if name in names or name not in foreign
        }

    def of_other_axes(self, signals: Iterable[str]) -> tuple[str, ...]:
        """Those of recordings' signals that only axes of the other kind have: what `inside` leaves out."""
        return tuple(name for name in signals if not self.inside({name: None}))

    def mismatch(self, needed: str, signals: Iterable[str]) -> str:
        """What is wrong, where a recording has what is `needed` inside for the other kind of axis; else ""."""
        other = next((name for name in (needed, linear_name(needed)) if name != self.signal(needed)), "")
        if not other or other not in signals:
            return ""
        kind, own = KINDS if other == needed else KINDS[::-1]
        return (
            f"the recording's axis is {kind}, as {other} says, and the actuator's is {own}; "
            "take an actuator of that axis, or correct [axes] in the actuator's file"
        )

    def outside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by the names that recordings have."""
        return {self.signal(name): values for name, values in signals.items()}


ROTARY_SIGNALS = {name for name, signal in SIGNALS.items() if signal.side and linear_name(name) != name}
ROTARY = Axes()

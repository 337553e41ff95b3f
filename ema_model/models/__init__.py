"""How an actuator's model stands beside recordings, in its closed loop or by inverse dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ema_model.actuator import Actuator
from ema_model.models.closed_loop import ClosedLoop
from ema_model.models.inverse_dynamics import InverseDynamics
from ema_model.models.model import Model, Window
from ema_model.recordings import Measurement

__all__ = ["ClosedLoop", "InverseDynamics", "Model", "Window", "model_for"]


def model_for(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    stretches: Sequence[list[slice] | None] | None = None,
) -> Model:
    """The closed loop where the controller is known; inverse dynamics where it is not, and for static maps."""
    if is_inverse(measurements, actuator):
        return InverseDynamics(measurements, actuator, effects=effects, stretches=stretches)
    return ClosedLoop(measurements, actuator, effects=effects, stretches=stretches)


def is_inverse(measurements: Sequence[Measurement], actuator: Actuator) -> bool:
    """Whether the motion is put in."""
    return actuator.controller.kind == "unknown" or any(m.is_map for m in measurements)

"""A digital drive answers late: by how much no actuator's file says, so that every comparison looks for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ema_model.actuator import Actuator, Tolerance
from ema_model.recordings import Measurement

_DELAY = "computation_delay"
_SERVO_SAMPLE_S = 2e-3  # of a usual position servo


def with_delay_of_drive(actuator: Actuator, measurements: Sequence[Measurement]) -> Actuator:
    """The actuator with a computation delay of 0 that a calibration may move.

    1 σ is about a sample of the recordings, of a position servo no less than its own, however fast it is logged.

    Without it, what the loop loses of its damping is taken for a torque constant or a current sensor that is off.
    As it is where its drive is the three-phase model's, which is not a digital one, or where no drive is simulated.
    """
    is_simulated = actuator.controller.kind in ("cascade", "position") or actuator.takes_voltage
    if not is_simulated or actuator.has_reference_model:
        return actuator
    if _DELAY in actuator.effects or not any(one.free for one in actuator.tolerances.values()):
        return actuator
    own = _SERVO_SAMPLE_S if actuator.controller.kind == "position" else 0.0
    late = Tolerance(max(own, *(one.sample_period_s for one in measurements)), True)
    return replace(
        actuator,
        effects={**actuator.effects, _DELAY: {"delay_s": 0.0}},
        tolerances={**actuator.tolerances, f"effects.{_DELAY}.delay_s": late},
    )

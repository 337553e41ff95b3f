"""Effects that the user makes: a torque from an expression, or from a curve."""

from __future__ import annotations

from ema_model.effects.user.curve import torque_curve
from ema_model.effects.user.expression import Expression, parse
from ema_model.effects.user.torque import user_torque
from ema_model.effects.user.user_effect import UserEffect

__all__ = ["Expression", "UserEffect", "parse", "torque_curve", "user_torque"]

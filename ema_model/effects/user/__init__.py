"""Effects that the user makes: a torque from an expression, or from a curve."""

from __future__ import annotations

from ema_model.effects.user.expression import Expression, parse
from ema_model.effects.user.torque import UserEffect, torque_curve, user_torque

__all__ = ["Expression", "UserEffect", "parse", "torque_curve", "user_torque"]

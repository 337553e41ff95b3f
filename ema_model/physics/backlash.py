"""Backlash as a play operator with memory (T 3.5.2; Simulink's Backlash block)."""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def advance_play(play, theta, half_width):
    """Output of the play: it stays where it is until the input pushes one of its flanks."""
    return clamp(play, theta - half_width, theta + half_width)

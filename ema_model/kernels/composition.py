"""What a stack is made of: here a cascade, the reduced circuit and no effect.

Each function is a *place* where an effect can act (see `ema_model.stacks.PLACES`).  `p` holds the rows of
parameters, `i` the lane; effects read their own parameters from the rows behind the base model's.
"""

from __future__ import annotations

from ema_model.numba_options import scalar
from ema_model.physics.controller import cascade_controller as control
from ema_model.physics.drive import reduced_drive as advance_current

__all__ = ["advance_current", "control", "electric_torque", "moving_friction", "shaft_torque"]


@scalar
def moving_friction(level, static, omega, motor_torque, load, p, i):
    """Friction in motion, N·m, from its Coulomb level."""
    return level


@scalar
def electric_torque(torque, theta, omega, current, p, i):
    """The motor's torque, N·m, from what its windings develop."""
    return torque


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, p, i):
    """Torque at the motor's shaft, friction apart, N·m, from that of motor, load and viscous drag."""
    return torque

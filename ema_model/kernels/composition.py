"""What a stack is made of: here a cascade, the reduced circuit and no effect.

Each function is a *place* where an effect can act (see `ema_model.stacks.PLACES`).  `p` holds the rows of
parameters, `s` those of the state, `i` the lane; effects read their own parameters from the rows behind the base
model's, and their own states from row `first` on.
"""

from __future__ import annotations

from ema_model.physics.equations import cascade_controller as control
from ema_model.physics.equations import reduced_drive as advance_current
from ema_model.physics.jit import scalar

__all__ = [
    "advance_current",
    "advance_states",
    "back_emf",
    "bus_voltage",
    "control",
    "current_reading",
    "current_reference",
    "drive_acts",
    "drive_output",
    "electric_torque",
    "friction",
    "goal",
    "integral_gain",
    "inverse_inertia",
    "loop_torque",
    "motor_angle_reading",
    "motor_speed_reading",
    "moving_friction",
    "position_error",
    "position_reading",
    "shaft_torque",
    "speed_command",
    "speed_gain",
    "speed_reading",
    "speed_sample",
    "user_position",
    "winding_resistance",
]


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, s, first, p, i):
    """Friction in motion, N·m, from its Coulomb level."""
    return level


@scalar
def friction(torque, omega, active, static, dynamic, s, first, p, i):
    """Friction's torque, N·m, from that of Borello's law."""
    return torque


@scalar
def electric_torque(torque, theta, omega, current, s, first, p, i):
    """The motor's torque, N·m, from what its windings develop."""
    return torque


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, s, first, p, i):
    """Torque at the motor's shaft, friction apart, N·m, from that of motor, load and viscous drag."""
    return torque


@scalar
def back_emf(emf, omega, current, gain, most, s, first, p, i):
    """The voltage against the drive, V, of the equivalent winding or of a phase."""
    return emf


@scalar
def winding_resistance(resistance, time, s, first, p, i):
    """Resistance, Ω, of the equivalent winding or of a phase."""
    return resistance


@scalar
def bus_voltage(volts, current, s, first, p, i):
    """Voltage of the supply, V, under an equivalent current, A."""
    return volts


@scalar
def inverse_inertia(inverse, s, first, p, i):
    """1/J, 1/(kg·m²)."""
    return inverse


@scalar
def user_position(user, theta, gear, s, first, p, i):
    """Where the user stands, rad, from the rigid transmission's output."""
    return user


@scalar
def position_reading(user, s, first, p, i):
    """What the position sensor tells the controller, rad."""
    return user


@scalar
def current_reading(current, s, first, p, i):
    """What the recorded equivalent current is, A."""
    return current


@scalar
def motor_angle_reading(theta, s, first, p, i):
    """What the motor's encoder tells of its angle, rad."""
    return theta


@scalar
def motor_speed_reading(omega, theta, s, first, p, i):
    """What the motor's encoder tells of its speed, rad/s."""
    return omega


@scalar
def goal(goal, gear, begins, dt, s, first, p, i):
    """The command that the position loop follows, rad at the user."""
    return goal


@scalar
def position_error(error, begins, dt, s, first, p, i):
    """The position error that the controller acts on, rad at the user."""
    return error


@scalar
def speed_reading(speed, begins, dt, s, first, p, i):
    """What the drive takes the motor's speed to be, rad/s."""
    return speed


@scalar
def speed_sample(speed, begins, dt, s, first, p, i):
    """The same as it is when the controller computes, rad/s."""
    return speed


@scalar
def speed_command(wanted, limit, begins, dt, s, first, p, i):
    """The speed that the position loop asks for, rad/s, kept to ±limit already."""
    return wanted


@scalar
def speed_gain(gain, s, first, p, i):
    """The speed loop's proportional gain, N·m·s/rad."""
    return gain


@scalar
def integral_gain(gain, speed_gain, s, first, p, i):
    """The speed loop's integral gain, N·m/rad."""
    return gain


@scalar
def loop_torque(torque, begins, dt, s, first, p, i):
    """What the speed loop asks for beside its proportional action, N·m."""
    return torque


@scalar
def drive_output(output, begins, dt, s, first, p, i):
    """What the controller puts out: a reference current, A, or a share of the bus voltage."""
    return output


@scalar
def current_reference(reference, begins, dt, s, first, p, i):
    """The current that the current loop brings about, A, as far as the voltage suffices."""
    return reference


@scalar
def drive_acts(p, i):
    """Whether an effect of the drive does anything."""
    return False


@scalar
def advance_states(dt, theta, omega, rigid, rigid_next, user_step, gear, load, active, static, dynamic, s, first, p, i):
    """Advances the effects' own states in `s`."""

"""The mechanics: dry friction with stick, the step of a rotor under it, and backlash."""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar

# --- Borello's dry friction with stick (T 3.5.1), and the step of a rotor under it ------------------------------------


@scalar
def borello_friction(omega, active_torque, static, dynamic):
    """Friction torque, N·m.

    At rest it balances the active torque up to ±static; in motion it is dynamic·sgn ω.
    (The thesis prints "V = 0 or |F| ≤ FSJ"; only "and" gives a rotor that can stick and move.)
    Where an effect takes the level in motion beyond static, so much holds at rest, too: else it would creep.
    """
    moving = dynamic if omega > 0.0 else -dynamic
    holds = max(static, dynamic)
    return clamp(active_torque, -holds, holds) if omega == 0.0 else moving


@scalar
def advance_rotor(theta, omega, net_torque, inverse_inertia, sticks, stop_low, stop_high, dt):
    """New angle and speed (T 3.13, semi-implicit Euler).

    sticks: whether friction is Borello's, of which a change of sign within the step stops the rotor (T 3.16), so that
    it is asked again at rest.  An end stop holds the angle and stops the rotor inelastically.
    """
    theta1, omega1, _ = advance_reversing_rotor(
        theta, omega, net_torque, inverse_inertia, sticks, stop_low, stop_high, 0.0, dt
    )  # fmt: skip
    return theta1, omega1


@scalar
def advance_reversing_rotor(theta, omega, net_torque, inverse_inertia, sticks, stop_low, stop_high, left, dt):
    """The same, and what is left of the step after the rotor has come to rest in it, s, which acts with the next.

    So a reversal is when the speed is zero, and not at a step's end: signals do not jump where a parameter moves it
    from one step into another, which a derivative by differences would take for a slope.
    """
    accelerated = omega + (dt + left) * inverse_inertia * net_torque
    stops = sticks & (accelerated * omega < 0.0)
    omega1 = 0.0 if stops else accelerated
    free = theta + (dt + 0.5 * left) * omega1
    theta1 = clamp(free, stop_low, stop_high)
    after = dt * accelerated / (accelerated - omega) if stops else 0.0
    return theta1, (omega1 if theta1 == free else 0.0), after


# --- backlash as a play operator with memory (T 3.5.2; Simulink's Backlash block) -------------------------------------


@scalar
def advance_play(play, theta, half_width):
    """Output of the play: it stays where it is until the input pushes one of its flanks."""
    return clamp(play, theta - half_width, theta + half_width)

"""A limit of how fast the drive lets its goal move."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def goal(goal, gear, begins, dt, rate, before):
    """θ_goal, which moves by v_max dt at most.  It begins at the command."""
    most = rate * dt
    after = goal if begins else clamp(goal, before - most, before + most)
    return after, after


EFFECT = Effect(
    title="Goal rate limit",
    equation="|dθ_goal/dt| ≤ v_max, θ_goal → θ_cmd",
    source="Ellis, Control System Design Guide, 4th ed., 2012: profiles of position commands",
    explanation=(
        "Servos and motion controllers do not hand a jump of the command to their loop: an interpolator moves the goal "
        "towards it at a profile velocity, which is set once and forgotten. A step becomes a ramp, a fast sine a "
        "triangle of smaller amplitude, while slower motions pass unchanged. The motor's top speed then is the "
        "profile's, whatever supply and load, and not the motor's own."
    ),
    parameters=(
        Parameter("rate_rad_s", "speed v_max of the goal", 0.5, 1e-4, 1e3, side=USER, linear=(0.05, 1e-6, 100.0)),
    ),
    severities=(1.0, 0.5, 0.25),
    places=(goal,),
    shows="in steps and fast sines: straight ramps of position, whose speed no load changes",
    mistaken_for="speed limit, acceleration limit, bus voltage sag, goal gain",
    family="drive",
    states=("goal_rad",),
    at_speeds=(1.0, 0.9, 0.7),
    nothing=1e9,
)

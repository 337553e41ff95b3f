"""Layout of what the kernels read and write: rows of LANES numbers, row r of lane i at r·LANES + i.

Flat arrays with constant row offsets are what lets LLVM prove that rows do not overlap.
Parameters of effects follow the base rows, in the order of the stack.
"""

from __future__ import annotations

LANES = 16  # 8 do not vectorise; of 32 a lane takes as long, and a small population has too few blocks for two cores

PARAMETER_ROWS = (
    # controller
    "position_gain",  # G, 1/s
    "speed_limit",  # rad/s
    "speed_gain",  # K_P, N·m·s/rad
    "integral_gain",  # K_I, N·m/rad
    "derivative_gain",  # K_D, N·m·s²/rad
    "integrator_window",  # rad at the user
    "integrator_rest",  # rad/s, at which speed and below the integral is held; below 0 never
    "current_per_torque",  # A/(N·m)
    "output_limit",  # of the controller: A, or for a voltage drive a share of the bus
    # inverter and motor
    "bus_voltage",  # V
    "voltage_ratio",  # of the bus: ½ for the RM's legs, the equivalent winding's limit for the MM
    "hysteresis",  # A, half the band's width
    "resistance",  # Ω
    "inverse_inductance",  # 1/H
    "torque_constant",  # N·m/A
    "emf_constant",  # V·s/rad
    "turns_a",
    "turns_b",
    "turns_c",  # healthy fraction of turns
    "eccentricity",  # ζ
    "eccentricity_cos",
    "eccentricity_sin",  # of the phase φ
    "torque_limit",  # N·m
    "pole_pairs",
    *(f"flux_{i}" for i in range(9)),  # the MM's `flux_harmonics`
    # transmission
    "inverse_inertia",  # 1/(kg·m²)
    "viscous",  # N·m·s/rad
    "static_friction",  # N·m
    "dynamic_friction",  # N·m
    "half_play",  # rad at the motor
    "gear_ratio",  # τ
    "stop_low",
    "stop_high",  # rad at the motor
)
(
    POSITION_GAIN,
    SPEED_LIMIT,
    SPEED_GAIN,
    INTEGRAL_GAIN,
    DERIVATIVE_GAIN,
    INTEGRATOR_WINDOW,
    INTEGRATOR_REST,
    CURRENT_PER_TORQUE,
    OUTPUT_LIMIT,
    BUS_VOLTAGE,
    VOLTAGE_RATIO,
    HYSTERESIS,
    RESISTANCE,
    INVERSE_INDUCTANCE,
    TORQUE_CONSTANT,
    EMF_CONSTANT,
    TURNS_A,
    TURNS_B,
    TURNS_C,
    ECCENTRICITY,
    ECCENTRICITY_COS,
    ECCENTRICITY_SIN,
    TORQUE_LIMIT,
    POLE_PAIRS,
    FLUX_0,
    FLUX_1,
    FLUX_2,
    FLUX_3,
    FLUX_4,
    FLUX_5,
    FLUX_6,
    FLUX_7,
    FLUX_8,
    INVERSE_INERTIA,
    VISCOUS,
    STATIC_FRICTION,
    DYNAMIC_FRICTION,
    HALF_PLAY,
    GEAR_RATIO,
    STOP_LOW,
    STOP_HIGH,
) = range(len(PARAMETER_ROWS))

STATE_ROWS = (
    "theta",  # motor angle, rad
    "omega",  # motor speed, rad/s
    "play",  # output of the backlash, rad at the motor
    "sin_rotor",
    "cos_rotor",  # of the motor angle with the rotor's offset
    "sin_electrical",
    "cos_electrical",  # the RM's of θ_e = N_p times that, the MM's of 2θ_e
    "current",  # equivalent current I_3eq, A
    "integral",  # K_I ∫e dt of the speed loop, N·m
    "speed_error",  # e of the step before, rad/s
    "user",  # where the user stands, rad
    "told",  # what the position sensor tells of it, rad
    "begun",  # 0 before the drive's first step, then 1; −1 where it has followed its command before it
    "time",  # since the recording's start, s
    "demand",  # what the drive asks for in this step, where more than the plain cascade acts: A, or a share of the bus
    "left",  # of the step in which the rotor came to rest, s
)
(
    THETA,
    OMEGA,
    PLAY,
    SIN_ROTOR,
    COS_ROTOR,
    SIN_ELECTRICAL,
    COS_ELECTRICAL,
    CURRENT,
    INTEGRAL,
    SPEED_ERROR,
    USER,
    TOLD,
    BEGUN,
    TIME,
    DEMAND,
    LEFT,
) = range(len(STATE_ROWS))

REFERENCE_STATE_ROWS = (
    *STATE_ROWS,
    "current_a",
    "current_b",
    "current_c",  # A
    "leg_a",
    "leg_b",
    "leg_c",  # ±1, the relay of each leg
    "motor_torque",  # N·m
)
(
    CURRENT_A,
    CURRENT_B,
    CURRENT_C,
    LEG_A,
    LEG_B,
    LEG_C,
    MOTOR_TORQUE,
) = range(len(STATE_ROWS), len(REFERENCE_STATE_ROWS))

"""What `emaviz actuator new` is told for each actuator that is shipped, and nothing else."""

from __future__ import annotations

_GAINS = {100: 0.28774, 200: 0.57548, 400: 1.15097, 800: 2.30194}  # duty per rad by the servo's gain register


def _set(**sections: dict[str, str]) -> list[str]:
    return [f"--set={section}.{name}={text}" for section, given in sections.items() for name, text in given.items()]


THESIS = [
    *("--controller=cascade", "--drive=hysteresis", "--gear=500:1", "--name=Thesis EMA"),
    "--description=48 V three-phase brushless motor, 500:1 transmission, 22.5 A",
    *_set(
        controller={
            "position_gain_1_s": "1e5",
            "speed_limit_rad_s": "837.758",
            "speed_gain_Nms_rad": "0.05",
            "integrator_window_rad": "1e-3",
            "current_limit_A": "22.5",
        },
        inverter={"bus_voltage_V": "48", "hysteresis_band_A": "0.5"},
        motor={
            "resistance_Ohm": "2.13",
            "inductance_H": "0.72e-3",
            "torque_constant_Nm_A": "0.0752",
            "emf_scale": "1.4142135623730951",
            "pole_pairs": "2",
            "torque_limit_Nm": "1.689",
            "inertia_kgm2": "1.3e-5",
            "viscous_friction_Nms_rad": "9.549e-6",
            "static_friction_Nm": "0.10134",
            "dynamic_friction_Nm": "0.05067",
            "rotor_offset_rad": "0 ± 0.02 fixed",
        },
        transmission={
            "backlash_rad": "1e-5",
            "viscous_friction_Nms_rad": "4.507e-7",
            "stop_low_rad": "-1.5",
            "stop_high_rad": "1.5",
        },
        sensors={"current_gain": "1", "current_bias_A": "0", "delay_s": "0"},
    ),
]
XL330 = [
    *("--controller=position", "--drive=voltage", "--name=XL330 on a pendulum"),
    "--description=Position servo, PWM voltage drive, arm under gravity",
    *_set(
        model={"step_s": "5e-4"},
        controller={"gain_1_rad": "0.28774"},
        inverter={"bus_voltage_V": "7.4 fixed"},
        motor={
            "torque_constant_Nm_A": "0.4 ± 15%",
            "resistance_Ohm": "5 ± 15%",
            "inertia_kgm2": "6e-3 ± 15%",
            "viscous_friction_Nms_rad": "0.01 ± 0.01",
            "static_friction_Nm": "0 fixed",
            "dynamic_friction_Nm": "0.03 ± 0.02",
        },
        sensors={"delay_s": "0 ± 3e-3"},
    ),
    "--effect=pendulum_load:moment_Nm=0.4807±5%,angle_rad=0±0.05",
    *("--map=time_s=t_s", "--map=command_rad=q_goal_rad", "--map=user_position_rad=q_rad"),
    *("--map=motor_speed_rad_s=dq_rad_s", "--map=duty=duty", "--map=bus_voltage_V=vin_V"),
    *("--map=temperature_C=temp_C", "--map=drive_enabled=torque_enable"),
    *(f"--where=*kp{kp}*:controller.gain_1_rad={gain}" for kp, gain in _GAINS.items()),
]
ODRIVE = [
    *("--controller=unknown", "--drive=unknown", "--name=ODrive motor"),
    "--description=Brushless motor without load, inverse dynamics",
    *_set(
        model={"torque_known": "false"},
        motor={
            "torque_constant_Nm_A": "0.03 fixed",
            "inertia_kgm2": "1e-4 ± 30%",
            "viscous_friction_Nms_rad": "1e-5 ± 1e-4",
            "static_friction_Nm": "0",
            "dynamic_friction_Nm": "0.01 ± 0.01",
        },
        sensors={"current_bias_A": "0 ± 0.1"},
    ),
    *("--map=segment=run", "--map=time_s=t_s", "--map=motor_position_rad=theta_rad", "--map=current_A=iq_A"),
    "--where=holdmap*:map",
]
BALL_SCREW = [
    *("--user=linear", "--lead-mm=10", "--controller=cascade", "--drive=current", "--name=Ball-screw axis"),
    "--description=Servo motor, 10 mm ball screw, 20 kg table, position-speed cascade",
    *_set(
        controller={
            "position_gain_1_s": "18850",
            "speed_limit_rad_s": "314.16",
            "speed_gain_Nms_rad": "0.03",
            "integral_gain_Nm_rad": "2.0",
            "integrator_window_m": "1.0",
            "current_limit_A": "12",
        },
        inverter={"current_limit_A": "12"},
        motor={
            "torque_constant_Nm_A": "0.25 ± 5%",
            "inertia_kgm2": "8.1e-5 ± 10%",
            "viscous_friction_Nms_rad": "2e-4 ± 30%",
            "static_friction_Nm": "0.09 ± 20%",
            "dynamic_friction_Nm": "0.06 ± 20%",
        },
        transmission={"backlash_m": "1e-5", "stop_low_m": "-0.25", "stop_high_m": "0.25"},
        sensors={"current_bias_A": "0", "delay_s": "0 ± 1e-3"},
    ),
]
WORKED = {"thesis": THESIS, "xl330": XL330, "odrive": ODRIVE, "ball_screw": BALL_SCREW}

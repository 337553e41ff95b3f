"""Back again: a joint of an MJCF model, with the actuator that drives it, as the tables of an actuator file."""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from typing import Any

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.exports import mjcf
from ema_model.quantities import MOTOR, USER, Axes

_FAST = 1e4  # rad/s: a speed limit that is none
_STRONG = 1e3  # times the dry friction: a torque limit where the model has none
_SAME = 1e-3  # relative


def joint_tables(text: str) -> tuple[dict[str, Any], str, str, list[str]]:
    """A joint of "model.xml#joint": tables with the names of files, kinds of controller and drive, and notes.

    The inertia is that of the joint at the model's own position, links and armature.  What MuJoCo's actuator is
    decides the controller: a position servo with damping is a cascade, one without it a position loop, a `motor` an
    open loop, a `dcmotor` what its input says; any other is unknown, and left to inverse dynamics.
    Raises InputError where MuJoCo is not installed, for a file that is no MJCF, and for a joint that it does not have.
    """
    mjcf.check()
    file, _, wanted = text.rpartition("#") if "#" in text else (text, "", "")
    model, mujoco = _model(file)
    joint = _joint(model, mujoco, file, wanted)
    kind, slide = int(model.jnt_type[joint]), int(mujoco.mjtJoint.mjJNT_SLIDE)
    if kind not in (slide, int(mujoco.mjtJoint.mjJNT_HINGE)):
        raise InputError(f"{quoted(text)}: is a free or ball joint; name a hinge or a slide")
    linear = kind == slide
    axes = Axes("linear", "linear") if linear else Axes()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    dof = model.jnt_dofadr[joint]
    friction = float(model.dof_frictionloss[dof])
    motor = {
        "inertia_kgm2": float(model.dof_M0[dof]),
        "viscous_friction_Nms_rad": float(_first(model.dof_damping[dof])),
        "static_friction_Nm": friction,
        "dynamic_friction_Nm": friction,
        "torque_constant_Nm_A": 1.0,
    }
    sections: dict[str, dict[str, float]] = {"motor": motor, "transmission": {}}
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint].tolist()
        sections["transmission"] |= {"stop_low_rad": low, "stop_high_rad": high}
    controller, drive, notes = _driven(model, mujoco, joint, sections)
    if controller == "unknown":
        sections["transmission"].clear()
    tables: dict[str, Any] = {"axes": {"motor": axes.motor, "user": axes.user}}
    for section, values in sections.items():
        side = USER if section == "transmission" else MOTOR
        named = {_name(axes, name, side): {"value": value} for name, value in values.items()}
        if named:
            tables[section] = named
    if float(_first(model.jnt_stiffness[joint])) != 0.0:
        tables["effects"] = {"hinge_moment": _spring(model, joint, axes)}
    return tables, controller, drive, notes


def _model(file: str) -> tuple[Any, Any]:
    mujoco: Any = importlib.import_module("mujoco")  # which states no types
    if not Path(file).is_file():
        raise InputError(f"{quoted(file)}: no such file; name an MJCF model and its joint, as model.xml#joint")
    try:
        return mujoco.MjModel.from_xml_path(file), mujoco
    except ValueError as error:
        raise InputError(f"{quoted(file)}: MuJoCo cannot read it: {quoted(error, 200)}") from None


def _joint(model: Any, mujoco: Any, file: str, wanted: str) -> int:
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) or "" for i in range(model.njnt)]
    if wanted in names and wanted:
        return names.index(wanted)
    if not wanted and model.njnt == 1:
        return 0
    known = [quoted(name, 40) for name in names if name]
    listed = ", ".join(known[:12]) + (" …" if len(known) > 12 else "")
    if not wanted:
        raise InputError(
            f"{quoted(file)}: say which joint, as {quoted(file)}#NAME; it has {listed or 'none with a name'}"
        )
    like = did_you_mean(wanted, known)
    raise InputError(f"{quoted(file)}: has no joint {quoted(wanted)!r}; it has {listed or 'none with a name'}{like}")


def _driven(model: Any, mujoco: Any, joint: int, sections: dict[str, dict[str, float]]) -> tuple[str, str, list[str]]:
    """The kinds of controller and drive, of the first actuator of the joint; its values are put into the sections."""
    on_joint = int(mujoco.mjtTrn.mjTRN_JOINT)
    found = [
        i for i in range(model.nu) if model.actuator_trntype[i] == on_joint and model.actuator_trnid[i, 0] == joint
    ]
    if not found:
        return "unknown", "current", ["no actuator drives the joint: its controller is unknown"]
    one = found[0]
    notes = [f"the joint has {len(found)} actuators, and the first is taken"] if len(found) > 1 else []
    gear = float(model.actuator_gear[one, 0])
    if gear <= 0.0:
        return (
            "unknown",
            "current",
            [*notes, f"the actuator's gear is {gear:g}, and only one above 0 is a transmission"],
        )
    _at_motor(sections, gear)
    gain, bias = model.actuator_gainprm[one], model.actuator_biasprm[one]
    limit = float(model.actuator_forcerange[one, 1]) if model.actuator_forcelimited[one] else math.inf
    kinds = int(model.actuator_gaintype[one]), int(model.actuator_biastype[one])
    fixed, of_dcmotor = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_DCMOTOR)
    none, affine = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
    if kinds == (fixed, none):
        sections["motor"]["torque_limit_Nm"] = min(limit, 1e9)
        return "open", "current", notes
    if kinds == (fixed, affine) and gain[0] > 0.0 and abs(gain[0] + bias[1]) <= _SAME * gain[0]:
        return (*_servo(sections, float(gain[0]), -float(bias[2]), 0.0, gear, limit), notes)
    if kinds[0] == of_dcmotor:
        return _dcmotor(model, mujoco, one, sections, gear, limit, notes)
    return "unknown", "current", [*notes, "its actuator is no motor and no position servo: its controller is unknown"]


def _at_motor(sections: dict[str, dict[str, float]], gear: float) -> None:
    """What stands at the joint, as the motor before the gear feels it."""
    motor = sections["motor"]
    motor["inertia_kgm2"] /= gear**2
    motor["viscous_friction_Nms_rad"] /= gear**2
    motor["static_friction_Nm"] /= gear
    motor["dynamic_friction_Nm"] /= gear
    if gear != 1.0:
        sections["transmission"]["gear_ratio"] = 1.0 / gear


def _servo(
    sections: dict[str, dict[str, float]], kp: float, kd: float, ki: float, gear: float, limit: float
) -> tuple[str, str]:
    """A loop in torque at the motor: kp and ki per motor angle that is missing, kd per motor speed."""
    motor = sections["motor"]
    most = limit if math.isfinite(limit) else _STRONG * max(motor["dynamic_friction_Nm"], kp * 1e-3)
    sections["inverter"] = {"current_limit_A": most}
    if kd <= 0.0:
        sections["controller"] = {"gain_1_rad": kp * gear / (most * motor["torque_constant_Nm_A"])}
        return "position", "current"
    sections["controller"] = {
        "position_gain_1_s": kp / kd * gear,
        "speed_limit_rad_s": _FAST,
        "speed_gain_Nms_rad": kd,
        "integral_gain_Nm_rad": ki * kd / kp,
        "torque_constant_Nm_A": motor["torque_constant_Nm_A"],
        "current_limit_A": most,
    }
    return "cascade", "current"


def _dcmotor(
    model: Any,
    mujoco: Any,
    one: int,
    sections: dict[str, dict[str, float]],
    gear: float,
    limit: float,
    notes: list[str],
) -> tuple[str, str, list[str]]:
    resistance, constant = (float(value) for value in model.actuator_gainprm[one][:2])
    motor = sections["motor"]
    motor["torque_constant_Nm_A"] = constant
    if math.isfinite(limit):
        motor["torque_limit_Nm"] = limit
    spec = int(model.actuator_ctrlspec[one])
    kp, ki, kd, most = (float(value) for value in model.actuator_gainprm[one][4:8])
    if spec & int(mujoco.mjtCtrlInput.mjINPUT_POS) and kp > 0.0:
        braking = constant**2 / resistance
        if most > 0.0 and ki == 0.0 and abs(kd - braking) <= _SAME * braking:
            motor["resistance_Ohm"] = resistance
            sections["inverter"] = {"bus_voltage_V": most}
            sections["controller"] = {"gain_1_rad": kp * resistance / (constant * most) * gear}
            return "position", "voltage", notes
        controller, drive = _servo(sections, kp, kd, ki, gear, limit / constant)
        if most > 0.0:
            notes = [*notes, f"the limit of its voltage, {most:g} V, is left out: its current comes at once here"]
        return controller, drive, notes
    if spec & int(mujoco.mjtCtrlInput.mjINPUT_VOLTAGE):
        motor["resistance_Ohm"] = resistance
        return "open", "voltage", notes
    return (
        "unknown",
        "current",
        [*notes, "its dcmotor follows no position and takes no voltage: its controller is unknown"],
    )


def _spring(model: Any, joint: int, axes: Axes) -> dict[str, Any]:
    stiffness = float(_first(model.jnt_stiffness[joint]))
    offset = -stiffness * float(model.qpos_spring[model.jnt_qposadr[joint]])
    return {
        axes.name("stiffness_Nm_rad", USER): {"value": stiffness},
        axes.name("offset_Nm", USER): {"value": offset},
    }


def _name(axes: Axes, name: str, side: Any) -> str:
    if name == "gear_ratio":
        return name
    return axes.name(name, USER if name == "gain_1_rad" else side)


def _first(value: Any) -> Any:
    """Of a polynomial's coefficients the linear one."""
    return value.flat[0] if getattr(value, "ndim", 0) else value

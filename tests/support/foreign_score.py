"""What a discovery on a foreign rig is worth, as the rig's README says what a right answer is."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from ema_model.actuator.parameters import path_inside
from ema_model.comparison.thresholds import BAND
from ema_model.comparison.verdict import most_of_floor
from ema_model.effects import CATALOGUE
from ema_model.quantities import HALF_90
from support.foreign_rigs import actuator_of

SHOWABLE = 3.0  # `change_over_floor` of what a recording must tell; below 1 nobody can, between them hardly
_HARDLY = 1.0
_OWN_DELAY_SAMPLES = 2.0  # of the drive: a delay up to so many is its own
_LARGEST_GROUP = 3  # with which a name is still an answer
_PARAMETERS = {  # effects that are a wrong value of a parameter, by what the parameter's path has, on both axes
    "viscous_friction": ("viscous",),
    "inertia_error": ("inertia", "mass"),
    "demagnetisation": ("torque_constant", "force_constant"),
    "winding_resistance": ("resistance",),
}
_VALUES = {  # what the rig hides that is a value of the actuator, by what its path has
    "viscous": ("viscous",),
    "inertia": ("inertia", "mass"),
    "weak_magnet": ("torque_constant", "force_constant"),
    "current_gain": ("torque_constant", "force_constant"),
    "resistance": ("resistance",),
}
_ARM = "effects.pendulum_load.angle_rad"
# What the rig hides that the library holds under these names; its own truth, older than they are, has "curve" alone.
_SINCE = {
    "saturation": ("torque_saturation",),
    "warmup": ("friction_drift", "resistance_drift"),
    "drag": ("quadratic_drag",),
    "load_friction": ("mesh_friction",),
    # By the user's place, and the first is by the motor's angle: over little travel one ridge or trough is a zone.
    "screw_friction": ("position_dependent_friction", "friction_zone"),
}
# What the two positions show by themselves, by its cause; a model without a controller stops at the motor.
_BEYOND_THE_MOTOR = {"acceleration": "torsional_compliance", "position": "screw_lead_error"}
_RUNOUT_SHARE = 0.5  # of the encoder's true runout, which every rig but a tidy one has, that a named one may be off by
_BIAS_SHARE = 0.5  # of the current sensor's true bias, which every rig has, that a named one may be off by
_BY_TOLERANCE = 3.0  # σ of the file's, within which a value is ordinary
COLUMNS = ("right", "false", "silent", "hardly showable", "unknown with its variable", "contradicts", "at bound",
           "drive told", "as the file allows", "too faint")  # fmt: skip


def tally(row: Mapping[str, Any], truth: Mapping[str, Any]) -> Counter[str]:
    """Counts of one row of `discover`; `silent` is what could have been told, and was not.

    `too faint`: what is hidden was named, though it changes no logged signal by a floor; the rigs' rule asks that
    nothing be named there, so that it is false as well.
    """
    hidden = truth["hidden"]
    told = [name for name, one in hidden.items() if max(one["change_over_floor"].values()) > _HARDLY]
    shown = any(max(one["change_over_floor"].values()) >= SHOWABLE for one in hidden.values())
    right = _names(truth, told)
    # Alone it is false to name what nobody can tell; of a mess, what is not in it.
    there = _names(truth, hidden) if len(hidden) > 1 else right
    groups = [{name, *filter(None, same.split("+"))} for name, same in zip(row["effects"], row["same_as"])]
    values = json.loads(row["parameters"])
    wrong = [
        name
        for name, group in zip(row["effects"], groups)
        if not group & there
        and not _drives(name)
        and not _is_the_drives_delay(name, values, truth["drive"]["rate"])
        and not _is_the_sensors_bias(group, values, truth["drive"]["current_bias"])
        and not _is_the_encoders_runout(name, values, truth["channels"])
    ]
    parts = [part for name, each in _PARAMETERS.items() if name in right for part in each]
    outside = any(part in path for part in parts for path in row["outside"])
    named = bool(groups) and bool(groups[0] & right) and len(groups[0]) <= _LARGEST_GROUP
    curve = bool(right & {"curve", "unknown"}) and not groups and bool(row["unknown"])
    most = most_of_floor((row["floor_band"][1] - 1.0) / HALF_90)
    above = row["ladder"][-1] is None or row["ladder"][-1] > most
    shaft = _BEYOND_THE_MOTOR.get(row.get("transmission") or "") in right
    correct = (named or outside or shaft) and not wrong
    drive = bool(row.get("controller_mismatch")) or any(map(_drives, row["effects"]))
    return Counter(
        {
            "cases": 1,
            "showable": int(shown),
            "right": int(shown and correct),
            "false": int(bool(wrong)),
            "silent": int(shown and not wrong and not correct and not curve),
            "hardly showable": int(bool(hidden) and not shown),
            "unknown with its variable": int(shown and curve),
            "contradicts": int(row["verdict"] in ("adequate", "effects_found") and above),
            "at bound": int(bool(row["at_bound"])),
            "drive told": int(drive or row["verdict"] == "adequate"),
            "as the file allows": int(shown and allowed(truth)),
            "too faint": int(not told and any(group & _names(truth, hidden) for group in groups)),
        }
    )


def allowed(truth: Mapping[str, Any]) -> bool:
    """Whether what is hidden is a value that its actuator's file calls ordinary: who trusts the file cannot tell it.

    A gain of the current within the loop is one of the torque constant; a turned position, of the angle of an arm.
    """
    if len(truth["hidden"]) != 1:
        return False
    name, one = next(iter(truth["hidden"].items()))
    parts, gain = _VALUES.get(name, ()), one["parameters"].get("current_gain", 1.0)
    true = {path: value / gain for path, value in truth["actuator"].items() if any(part in path for part in parts)}
    if name == "position_bias":
        true[_ARM] = one["parameters"]["scale_bias"]
    actuator = actuator_of(truth["rig"])
    inside = {path_inside(path, actuator.tolerances, actuator.axes): value for path, value in true.items()}
    told = {path: actuator.tolerances[path].sigma for path in inside if path in actuator.tolerances}
    far = [abs(inside[path] - actuator.value(path)) / sigma for path, sigma in told.items()]
    return bool(far) and max(far) < _BY_TOLERANCE


def _names(truth: Mapping[str, Any], hidden: Iterable[str]) -> set[str]:
    """What these hidden effects may be called."""
    return {name for one in hidden for name in (*truth["hidden"][one]["right"], *_SINCE.get(one, ()))}


def covered(row: Mapping[str, Any], truth: Mapping[str, Any]) -> list[tuple[bool, float]]:
    """Of each interval of a parameter: whether it holds the true value, and its half width over that value.

    None of a model that leaves more than a true one may, or more than a name for it: there nothing is promised.
    """
    if row["ladder"][-1] is None or row["ladder"][-1] > BAND or row["unknown"]:
        return []
    found = json.loads(row["calibrated"])
    return [
        (found[path][1] <= true <= found[path][2], 0.5 * (found[path][2] - found[path][1]) / abs(true))
        for path, true in truth["actuator"].items()
        if path in found and None not in found[path]
    ]


def line(row: Mapping[str, Any]) -> str:
    """The answer in a line."""
    ladder = " → ".join("?" if rmse is None else f"{rmse:.3g}" for rmse in row["ladder"])
    names = ", ".join("≡".join(filter(None, [name, same])) for name, same in zip(row["effects"], row["same_as"]))
    bound = f" | at bound {', '.join(row['at_bound'])}" if row["at_bound"] else ""
    outside = f" | outside {', '.join(row['outside'])}" if row["outside"] else ""
    goes = f" | goes with {row['unknown']}" if row["unknown"] else ""
    goes += f" | user and motor: {row['transmission']}" if row.get("transmission") else ""
    drive = " | not the controller of the file" if row.get("controller_mismatch") else ""
    return f"{row['verdict']:16} {names or '-'} | {ladder}{goes}{outside}{bound}{drive}"


def _drives(name: str) -> bool:
    return name in CATALOGUE and CATALOGUE[name].family == "drive"


def _is_the_drives_delay(name: str, values: Mapping[str, Mapping[str, float]], rate: float) -> bool:
    return name == "position_sensor_delay" and values[name].get("delay_s", 0.0) <= _OWN_DELAY_SAMPLES / rate


def _is_the_encoders_runout(name: str, values: Mapping[str, Mapping[str, float]], channels: Mapping[str, Any]) -> bool:
    true = channels.get("motor_position_rad", {}).get("runout", 0.0)
    return name == "encoder_eccentricity" and abs(values[name]["amplitude_rad"] - true) <= _RUNOUT_SHARE * true


def _is_the_sensors_bias(group: set[str], values: Mapping[str, Mapping[str, float]], true_A: float) -> bool:
    """Whether a group has the current sensor's bias in it, and, where that one was fitted, its true size."""
    if "current_sensor_bias" not in group:
        return False
    fitted_A = values.get("current_sensor_bias", {}).get("bias_A", true_A)
    return abs(fitted_A - true_A) <= _BIAS_SHARE * abs(true_A)

"""The JSON logs of servos on a pendulum by Rhoban/bam (github.com/Rhoban/bam, bam/xl330/record.py and its likes).

One object: the rig's mass, length, kp, vin, motor and trajectory, and `entries`, a record for each sample.  Units stand
in the recorder's source alone: position, speed and goal in radians, `load` as a ratio or, in its logs of January 2026
(bam/data.bak/raw at commit af22604), as the register that holds counts of the PWM's limit: 65 535 stands for −1.
"""

from __future__ import annotations

from typing import Any

_UNITS = {
    "timestamp": "s",
    "position": "rad",
    "goal_position": "rad",
    "speed": "rad/s",
}
_SIGNALS = {"input_volts": "bus_voltage_V", "temp": "temperature_C", "torque_enable": "drive_enabled"}
_PWM_LIMITS = {"xl330": 885, "xl330i": 885}  # counts of the full duty; of the XL330's control table
_REGISTER = 1 << 16  # values of a register with a sign, written as it stands
_KEYS = {"mass", "length", "kp", "motor", "entries"}


def is_one(document: Any) -> bool:
    """Whether it is such a log."""
    if not isinstance(document, dict) or not document.keys() >= _KEYS:
        return False
    entries = document["entries"]
    return isinstance(entries, list) and bool(entries) and isinstance(entries[0], dict) and "position" in entries[0]


def with_units(document: dict[str, Any]) -> dict[str, Any]:
    """The log as columns with the units in their names, and the duty as a ratio where the motor's limit is known."""
    entries = [entry for entry in document["entries"] if isinstance(entry, dict)]
    columns = {key: [entry.get(key) for entry in entries] for key in entries[0]}
    limit = _PWM_LIMITS.get(document["motor"]) if isinstance(document["motor"], str) else None
    names = _SIGNALS | {name: f"{name} [{unit}]" for name, unit in _UNITS.items()}
    if limit and (duties := _duties(columns.get("load", [None]), limit)):
        columns["load"], names["load"] = duties, "duty"
    return {**document, "entries": {names.get(key, key): values for key, values in columns.items()}}


def _duties(loads: list[Any], limit: int) -> list[float]:
    """The loads as ratios of the limit; nothing where some are none, as between counts of which the sign was lost."""
    if not all(isinstance(load, (int, float)) for load in loads):
        return []
    if all(abs(load) <= 1.0 for load in loads):  # as later versions of the recorder write them
        return [float(load) for load in loads]
    counts = [load - _REGISTER if load >= _REGISTER // 2 else load for load in loads]
    return [count / limit for count in counts] if all(abs(count) <= limit for count in counts) else []


def title(document: dict[str, Any]) -> str:
    """What tells one such log from another: "xl330 kp400 sin_sin"."""
    parts = (document["motor"], f"kp{document['kp']}", document.get("trajectory", ""))
    return " ".join(str(part) for part in parts)[:100]

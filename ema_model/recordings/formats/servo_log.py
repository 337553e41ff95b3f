"""The JSON logs of servos on a pendulum by Rhoban/bam (github.com/Rhoban/bam, bam/xl330/record.py and its likes).

One object: the rig's mass, length, kp, vin, motor and trajectory, and `entries`, a record for each sample.  Units stand
in the recorder's source alone: position, speed and goal in radians, `load` in counts of the PWM's limit or as a ratio.
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
_PWM_LIMITS = {"xl330": 885}  # counts of the full duty; of the XL330's control table
_KEYS = {"mass", "length", "kp", "motor", "entries"}


def is_one(document: Any) -> bool:
    """Whether it is such a log."""
    if not isinstance(document, dict) or not document.keys() >= _KEYS:
        return False
    entries = document["entries"]
    return isinstance(entries, list) and bool(entries) and isinstance(entries[0], dict) and "position" in entries[0]


def with_units(document: dict[str, Any]) -> dict[str, Any]:
    """The log with the units in its names, and the duty as a ratio where the motor's limit is known."""
    entries = [entry for entry in document["entries"] if isinstance(entry, dict)]
    loads = [load for entry in entries if isinstance(load := entry.get("load"), (int, float))]
    limit = _PWM_LIMITS.get(document["motor"]) if isinstance(document["motor"], str) else None
    is_duty = limit is not None and len(loads) == len(entries) > 0
    if limit is not None and is_duty:
        full = limit if max(abs(load) for load in loads) > 1.0 else 1  # later versions of the recorder write the ratio
        entries = [{**entry, "load": entry["load"] / full} for entry in entries]
    names = (
        _SIGNALS | {name: f"{name} [{unit}]" for name, unit in _UNITS.items()} | ({"load": "duty"} if is_duty else {})
    )
    return {**document, "entries": [{names.get(key, key): value for key, value in one.items()} for one in entries]}


def title(document: dict[str, Any]) -> str:
    """What tells one such log from another: "xl330 kp400 sin_sin"."""
    parts = (document["motor"], f"kp{document['kp']}", document.get("trajectory", ""))
    return " ".join(str(part) for part in parts)[:100]

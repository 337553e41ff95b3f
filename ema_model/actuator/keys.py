"""The keys of an actuator file besides its parameters, with what they mean: the reader knows no others.

The parameters themselves, with their facts, stand in `parameters`; effects in their own files.
"""

from __future__ import annotations

from ema_model.faults import FAULTS

HEAD = {
    "schema": "1, the version of this format",
    "name": "what the actuator is called; without it, the file's name",
    "description": "a sentence about it",
}
TABLES: dict[str, dict[str, str]] = {
    "axes": {
        "motor": "rotary or linear: whether the motor turns or is a linear motor",
        "user": "rotary or linear: whether what it moves turns or slides",
    },
    "model": {
        "step_s": "step of the simulation; without it 1e-5 s, with an ideal current 5e-5 s",
        "filter_s": "half width over which a measured motion is differentiated (unknown controller only)",
        "leaves_out_reversals": "true where only what slides steadily is compared (unknown controller only)",
        "torque_known": "false where the torque constant is a guess: findings are then told in amperes",
    },
    "faults": {fault.name: f"{fault.title.lower()} that this unit has, 0 … 1" for fault in FAULTS},
    "recordings": {
        "mapping": 'list of "signal=column[unit]", for recordings with other names, as for --map',
        "where": "tables of what differs by the recordings' names",
    },
    "recordings.where": {
        "match": 'pattern of file names without their ending, such as "*kp100*"',
        "set": 'table of "section.parameter" = value that hold for these recordings',
        "kind": "run, or map for a static map, without time: current or torque against angle, speed or load",
    },
}
KINDS = {
    "controller": {
        "cascade": "position and speed loop",
        "position": "a position loop alone, as servos have it",
        "open": "left out: the recorded current or torque, or with a voltage drive the voltage or duty, is put in",
        "unknown": "not described: the recorded motion is put in and the current that it needs comes out",
    },
    "inverter": {
        "hysteresis": "current relays that chop the bus voltage, with three phases (cascade only)",
        "current": "the current that is asked for, at once",
        "voltage": "PWM voltage at the winding (not of a cascade)",
    },
}
ENTRY = {
    "value": "in SI, the unit that the name ends in",
    "tolerance": "1 σ of what is not known of it, relative to the value",
    "sigma": "the same as an absolute number, where the value is 0",
    "free": "whether a calibration may move it, within 3 σ; true unless it says false",
}

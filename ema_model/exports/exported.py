"""What is exported of an actuator: its model's program, with its parameters, state and input as numbers with units."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.effects import find
from ema_model.errors import InputError, quoted
from ema_model.exports.program import Program, field_name, program_of
from ema_model.physics.rows import LANES, PARAMETER_ROWS, STATE_ROWS
from ema_model.quantities import MOTOR, USER, Axes, Side
from ema_model.simulation.pack import monitor_rows, own_stack
from ema_model.stacks import Stack

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """A number of the exported model: its name in code, its value, unit (as shown) and meaning."""

    name: str
    value: float
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Exported:
    """An actuator as other tools take it."""

    name: str  # of files and functions: small letters, digits and underscores
    actuator: Actuator  # in open loop where its controller is not known
    given: Actuator  # as it was given
    stack: Stack
    program: Program
    parameters: tuple[Field, ...]  # those that the program reads, in its order, then the rotor's offset
    states: tuple[Field, ...]  # at rest at 0
    command: Field  # what is put in
    rows: dict[str, float]  # of the kernels' parameters, all of them, by name
    notes: tuple[str, ...]  # what whoever takes it must know, in sentences

    @property
    def step_s(self) -> float:
        """The model's own step."""
        return self.actuator.step_s

    @property
    def takes_torque(self) -> bool:
        """Whether the motor's torque is put in."""
        return self.actuator.controller.kind == "open" and not self.actuator.takes_voltage

    @property
    def outputs(self) -> tuple[Field, ...]:
        """What its sensors show, in the order of the kernels."""
        axes = self.actuator.axes
        return (
            Field("current_A", 0.0, "A", "equivalent current"),
            Field(axes.signal("motor_speed_rad_s"), 0.0, axes.unit("rad/s", MOTOR), "motor speed"),
            Field(axes.signal("motor_position_rad"), 0.0, axes.unit("rad", MOTOR), "motor position"),
            Field(axes.signal("user_position_rad"), 0.0, axes.unit("rad", USER), "user position"),
        )

    @property
    def load(self) -> Field:
        """The load at the user."""
        axes = self.actuator.axes
        unit = axes.unit("N·m", USER)
        return Field(axes.signal("load_torque_Nm"), 0.0, unit, "load at the user, positive against positive motion")

    def values(self, rows: Mapping[str, float]) -> Array:
        """The parameters' numbers where the kernels' rows, by name, are these."""
        by_field = {field_name(name): value for name, value in rows.items()}
        return np.array([by_field.get(one.name, one.value) for one in self.parameters])


def exported(actuator: Actuator, name: str = "") -> Exported:
    """What is exported of an actuator.

    name: of files and functions; the actuator's own without one.
    Raises InputError for an effect with a line that has no form in other languages.
    """
    notes = []
    taken = actuator
    if actuator.controller.kind == "unknown":
        taken = actuator.in_open_loop()
        notes.append("Its controller is not known: exported as a plant that is driven by the motor's torque.")
    if not actuator.torque_known:
        notes.append("Its torque constant is a guess: torques, inertia and friction are known up to one common factor.")
    sensors = actuator.sensors
    if sensors.current_gain != 1.0 or sensors.current_bias_A != 0.0:
        shown = f"{sensors.current_gain:.4g} times the current here, and {sensors.current_bias_A:+.2g} A more"
        notes.append(f"Its recordings show {shown}; their sensor is no part of the export.")
    if sensors.delay_s != 0.0:
        notes.append(f"Its recordings are {1e3 * sensors.delay_s:.2g} ms late, which is no part of the export.")
    stack = own_stack(taken)
    program = program_of(stack)
    rows = dict(zip(stack.parameter_rows, monitor_rows(taken, taken.k, stack, {})[0].reshape(-1, LANES)[:, 0]))
    known = {**_base(taken), **_of_effects(taken)}
    by_field = {field_name(row): (float(value), *known[row]) for row, value in rows.items()}
    parameters = tuple(Field(one, *by_field[one]) for one in program.parameters)
    offset = Field("rotor_offset", taken.motor.rotor_offset_rad, "rad", "from the motor angle's zero to phase A")
    meanings = {**_states(taken.axes), **{name: ("", f"of {name.partition('.')[0]}") for name in stack.states}}
    return Exported(
        identifier(name or actuator.name),
        taken,
        actuator,
        stack,
        program,
        (*parameters, offset),
        tuple(Field(field_name(one), 0.0, *meanings[one]) for one in (*STATE_ROWS, *stack.states)),
        _command(taken),
        {name: float(value) for name, value in rows.items()},
        tuple(note.replace("-0", "−0") for note in notes),
    )


def identifier(name: str) -> str:
    """A name as every language takes it: 'XL330 on a pendulum' → 'xl330_on_a_pendulum'; InputError for none."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    found = re.sub(r"[^a-z0-9]+", "_", plain.lower()).strip("_")[:48].strip("_")
    if not found:
        raise InputError(f"{quoted(name)}: no name for files and functions can be made of it; give one with letters")
    return found if found[0].isalpha() else f"actuator_{found}"


def _command(actuator: Actuator) -> Field:
    axes = actuator.axes
    if actuator.takes_voltage:
        return Field("duty", 0.0, "", "the motor's voltage as a share of the bus voltage")
    if actuator.controller.kind == "open":
        unit = axes.unit("N·m", MOTOR)
        return Field(axes.signal("motor_torque_Nm"), 0.0, unit, "torque that the motor's current makes")
    return Field(axes.signal("command_rad"), 0.0, axes.unit("rad", USER), "where the user is to go")


# Of the kernels' rows: unit on rotary axes, the side where it sits, and what it is.
_MEANINGS: dict[str, tuple[str, Side | None, str]] = {
    "speed_limit": ("rad/s", MOTOR, "the most speed that the position loop asks for"),
    "speed_gain": ("N·m·s/rad", MOTOR, "proportional gain of the speed loop"),
    "integral_gain": ("N·m/rad", MOTOR, "integral gain of the speed loop"),
    "derivative_gain": ("N·m·s²/rad", MOTOR, "derivative gain of the speed loop"),
    "integrator_window": ("rad", USER, "position error beyond which the integral is held"),
    "integrator_rest": ("rad/s", MOTOR, "speed up to which the integral is held; below 0 never"),
    "current_per_torque": ("A/(N·m)", None, "1 over the controller's torque constant"),
    "bus_voltage": ("V", None, "of the supply"),
    "voltage_ratio": ("", None, "most voltage of the winding per bus voltage"),
    "hysteresis": ("A", None, "half the relays' band"),
    "resistance": ("Ω", None, "of the equivalent winding"),
    "inverse_inductance": ("1/H", None, "1 over the equivalent winding's inductance"),
    "torque_constant": ("N·m/A", MOTOR, "torque per equivalent current"),
    "emf_constant": ("V·s/rad", None, "back-EMF per motor speed"),
    "torque_limit": ("N·m", MOTOR, "at which the motor saturates"),
    "pole_pairs": ("", None, "of the rotor"),
    "inverse_inertia": ("1/(kg·m²)", None, "1 over the inertia of all that moves"),
    "viscous": ("N·m·s/rad", MOTOR, "viscous friction"),
    "static_friction": ("N·m", MOTOR, "dry friction that holds the standing motor"),
    "dynamic_friction": ("N·m", MOTOR, "dry friction in motion"),
    "half_play": ("rad", MOTOR, "half the backlash, at the motor"),
    "gear_ratio": ("", None, "how far the user moves per motor angle"),
    "stop_low": ("rad", MOTOR, "lower end stop, at the motor"),
    "stop_high": ("rad", MOTOR, "upper end stop, at the motor"),
}


def _base(actuator: Actuator) -> dict[str, tuple[str, str]]:
    """Unit and meaning of each row of the base model."""
    axes = actuator.axes
    found = {name: (axes.unit(unit, side), meaning) for name, (unit, side, meaning) in _MEANINGS.items()}
    is_loop = actuator.controller.kind == "position"
    gain = "share of the full output" if is_loop else "motor speed"
    found["position_gain"] = ("1/rad" if is_loop else "1/s", f"{gain} asked for per position error at the user")
    is_duty = actuator.circuit() == "voltage"
    found["output_limit"] = ("" if is_duty else "A", "the most that the controller asks for")
    found |= {
        f"flux_{i}": ("", "of the windings' torque over the rotor's angle; 1, 0, 0 … of healthy ones") for i in range(9)
    }
    return {name: found.get(name, ("", "")) for name in PARAMETER_ROWS}


def _of_effects(actuator: Actuator) -> dict[str, tuple[str, str]]:
    found = {}
    for name in actuator.effects:
        effect = find(name, actuator.axes)
        found |= {f"{name}.{p.name}": (p.unit, f"{effect.title}: {p.meaning}") for p in effect.parameters}
    return found


def _states(axes: Axes) -> dict[str, tuple[str, str]]:
    motor, user = axes.unit("rad", MOTOR), axes.unit("rad", USER)
    found = {
        "theta": (motor, "motor angle"),
        "omega": (axes.unit("rad/s", MOTOR), "motor speed"),
        "play": (motor, "output of the backlash, at the motor"),
        "sin_rotor": ("", "of the motor angle with the rotor's offset"),
        "cos_rotor": ("", "of the same"),
        "sin_electrical": ("", "of twice the electrical angle"),
        "cos_electrical": ("", "of the same"),
        "current": ("A", "equivalent current"),
        "integral": (axes.unit("N·m", MOTOR), "integral action of the speed loop"),
        "speed_error": (axes.unit("rad/s", MOTOR), "of the step before"),
        "user": (user, "where the user stands"),
        "told": (user, "what the position sensor tells of it"),
        "begun": ("", "0 before the drive's first step, then 1; −1 where it has followed its command before it"),
        "time": ("s", "since the start"),
        "demand": ("", "what the drive asks for"),
        "left": ("s", "of the step in which the rotor came to rest"),
    }
    return {name: found.get(name, ("", "")) for name in STATE_ROWS}

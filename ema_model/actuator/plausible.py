"""What an actuator's file lacks, and what in it is hard to believe, told without a recording."""

from __future__ import annotations

from collections.abc import Iterator

from ema_model.actuator.actuator import Actuator
from ema_model.actuator.describe import is_guess
from ema_model.actuator.layout import WITHOUT_DRIVE, layout
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import SECTIONS, default_of, facts_of
from ema_model.actuator.steps import loop_rate
from ema_model.actuator.unread import unread
from ema_model.quantities.numbers import number

# Units that data sheets have, by the SI unit that a file wants.
_ON_DATA_SHEETS: dict[str, tuple[tuple[str, float], ...]] = {
    "kg·m²": (("kg·cm²", 1e-4), ("g·cm²", 1e-7)),
    "kg": (("g", 1e-3),),
    "N·m/A": (("mN·m/A", 1e-3),),
    "N·m": (("mN·m", 1e-3), ("N·cm", 1e-2)),
    "N·m·s/rad": (("mN·m·s/rad", 1e-3), ("N·m/rpm", 9.5493)),
    "rad/s": (("rpm", 0.10472), ("°/s", 0.0174533)),
    "rad": (("mrad", 1e-3), ("°", 0.0174533)),
    "m": (("mm", 1e-3), ("µm", 1e-6)),
    "m/s": (("mm/s", 1e-3),),
    "H": (("mH", 1e-3), ("µH", 1e-6)),
    "Ω": (("mΩ", 1e-3),),
    "V": (("mV", 1e-3),),
    "A": (("mA", 1e-3),),
    "s": (("ms", 1e-3), ("µs", 1e-6)),
}
_WIDE = 0.5  # a tolerance, relative, from which on 3 σ reach below nothing
_APART = 0.2  # by which the controller's torque constant and the motor's may differ


def missing(actuator: Actuator) -> tuple[str, ...]:
    """What is still a guess, and what a fit would need."""
    told = []
    for path in _paths(actuator):
        if is_guess(path, actuator):
            told.append(f"{_shown(actuator, path)} is still a guess; put in what the data sheet says")
    if not any(tolerance.free for tolerance in actuator.tolerances.values()):
        told.append(
            "no parameter has a tolerance, so that nothing can be calibrated; write { value = …, tolerance = … }"
        )
    return tuple(told)


def implausible(actuator: Actuator) -> tuple[str, ...]:
    """What is far from all actuators, or does not fit the rest of the file."""
    return (*_out_of_range(actuator), *_wide(actuator), *_contradictions(actuator))


def _paths(actuator: Actuator) -> Iterator[str]:
    kinds = {"controller": actuator.controller.kind, "inverter": actuator.inverter.kind}
    silent = unread(**kinds)
    for section in SECTIONS:
        for name in sum(layout(section, kinds), ()):
            if f"{section}.{name}" not in silent:
                yield f"{section}.{name}"


def _shown(actuator: Actuator, path: str) -> str:
    named = on_axes(path, actuator.axes)
    return f"{named.path} = {actuator.value(path):g}"


def _out_of_range(actuator: Actuator) -> Iterator[str]:
    for path in _paths(actuator):
        value, facts = actuator.value(path), facts_of(path, actuator.axes)
        if value in (0.0, default_of(path)) or facts.low <= value <= facts.high:
            continue
        unit = on_axes(path, actuator.axes).unit
        fitting = [
            f"in {name} it would be {number(value * factor)} {unit}"
            for name, factor in _ON_DATA_SHEETS.get(unit, ())
            if facts.low <= value * factor <= facts.high
        ]
        usual = f"{number(facts.low)} … {number(facts.high)} {unit}".rstrip()
        yield f"{_shown(actuator, path)} is outside {usual}{'; ' if fitting else ''}{', '.join(fitting[:2])}"


def _wide(actuator: Actuator) -> Iterator[str]:
    for path, tolerance in actuator.tolerances.items():
        value = 0.0 if path.startswith("effects.") else actuator.value(path)
        if value and facts_of(path, actuator.axes).tolerance and tolerance.sigma > _WIDE * abs(value):
            share = tolerance.sigma / abs(value)
            if not path.endswith("friction_Nms_rad") and not path.endswith("friction_Nm"):
                yield f"{_shown(actuator, path)}: a tolerance of {share:.0%} lets a fit take it down to nothing"


def _contradictions(actuator: Actuator) -> Iterator[str]:
    motor, controller, inverter = actuator.motor, actuator.controller, actuator.inverter
    if 0.0 < motor.static_friction_Nm < motor.dynamic_friction_Nm:
        both = " is below ".join(
            _shown(actuator, f"motor.{name}") for name in ("static_friction_Nm", "dynamic_friction_Nm")
        )
        yield f"{both}: what stands is held by no less than what moves"
    if controller.kind in WITHOUT_DRIVE:
        return
    most = min(float(actuator.current_limit_A) * motor.torque_constant_Nm_A, motor.torque_limit_Nm)
    if inverter.kind == "voltage":
        most = inverter.bus_voltage_V / motor.resistance_Ohm * motor.torque_constant_Nm_A * controller.output_limit
    held = max(motor.static_friction_Nm, motor.dynamic_friction_Nm)
    if held >= most:
        unit = on_axes("motor.static_friction_Nm", actuator.axes).unit
        yield f"the motor gives {number(most)} {unit} at most and friction takes {number(held)} {unit}: it cannot move"
    if controller.kind == "cascade":
        taken, given = controller.torque_constant_Nm_A, motor.torque_constant_Nm_A
        if abs(taken - given) > _APART * given:
            told = [_shown(actuator, f"{one}.torque_constant_Nm_A") for one in ("controller", "motor")]
            yield f"{' and '.join(told)}: the controller counts with another motor"
        yield from _too_fast(actuator)


def _too_fast(actuator: Actuator) -> Iterator[str]:
    """A speed that the supply cannot reach, and a speed loop that its step cannot follow."""
    motor, controller, inverter = actuator.motor, actuator.controller, actuator.inverter
    if inverter.kind == "hysteresis":
        reached = 1.5 * inverter.bus_voltage_V / motor.torque_constant_Nm_A
        if controller.speed_limit_rad_s > reached:
            unit = on_axes("controller.speed_limit_rad_s", actuator.axes).unit
            yield (
                f"{_shown(actuator, 'controller.speed_limit_rad_s')} is above {number(reached)} {unit}, "
                "where the motor's back-EMF takes the whole supply"
            )
    rate = loop_rate(actuator)
    if rate * actuator.step_s > 0.5:
        gain = _shown(actuator, "controller.speed_gain_Nms_rad")
        yield f"{gain} makes a speed loop of {number(rate)} 1/s, too fast for steps of {number(actuator.step_s)} s"

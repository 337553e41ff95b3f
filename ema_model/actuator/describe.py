"""An actuator described by answers, and what is plausible."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from ema_model.actuator.actuator import Actuator, loop_rate, usual_filter, usual_step
from ema_model.actuator.file import actuator_of
from ema_model.actuator.parameters import (
    CONTROLLER_KINDS,
    SECTIONS,
    default_of,
    drives_of,
    facts_of,
    layout,
    on_axes,
    says_drive,
    unread,
)
from ema_model.errors import InputError, quoted
from ema_model.quantities import Axes, number

# --- what an actuator's file lacks, and what in it is hard to believe, told without a recording -----------------------

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
_POSITION_LOOPS_1_S = (0.3, 1e4)  # from a telescope's axis to a galvanometer's
_SLOWER = 4.0  # times the speed loop's rate, from which on a position loop over it is damped by less than a quarter
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
    if not says_drive(controller.kind, inverter.kind):
        return
    most = min(float(actuator.current_limit_A) * motor.torque_constant_Nm_A, motor.torque_limit_Nm)
    if inverter.kind == "voltage" and inverter.bus_voltage_V == 0.0:
        return  # the recordings say it
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
    if controller.kind in ("cascade", "position"):
        yield from _of_position_gain(actuator)


def _of_position_gain(actuator: Actuator) -> Iterator[str]:
    """A position loop that no axis has, and one that its speed loop cannot follow.

    The gain is from an error at the user to what the motor does, so that it holds the gear, or 2π over a screw's lead.
    """
    low, high = _POSITION_LOOPS_1_S
    motor, controller, tau = actuator.motor, actuator.controller, actuator.transmission.gear_ratio
    is_cascade = controller.kind == "cascade"
    path = "controller.position_gain_1_s" if is_cascade else "controller.gain_1_rad"
    gain, unit = actuator.value(path), on_axes(path, actuator.axes).unit
    rate = gain * tau if is_cascade else loop_rate(actuator)
    said = f"{_shown(actuator, path)} {unit}"
    if gain and not low <= rate <= high:
        usual = f"makes a position loop of {number(rate)} 1/s, where {number(low)} … {number(high)} 1/s are usual"
        other = ""
        if is_cascade and low <= gain <= high:
            other = f"; it is counted by the user's error and the motor's speed: {number(gain)} 1/s of either side "
            other += f"alone is {number(gain / tau)} {unit} here"
        yield f"{said} {usual}{other}"
    elif is_cascade and rate * motor.inertia_kgm2 > _SLOWER * controller.speed_gain_Nms_rad:
        speed = (
            f"a speed loop of {number(loop_rate(actuator))} 1/s ({_shown(actuator, 'controller.speed_gain_Nms_rad')})"
        )
        yield f"{said} makes a position loop of {number(rate)} 1/s over {speed}, which is slower: it would swing"


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


# --- an actuator from what somebody knows of it -----------------------------------------------------------------------
# An actuator from what somebody knows of it: the rest is guessed, with a wide tolerance, so that it can be
# calibrated.
#
# A description is what its file would hold, as tables of entries under the names that files have.

# Drives to choose from, by the controller, the usual one first.
DRIVES = {kind: drives_of(kind) if len(drives_of(kind)) > 1 else () for kind in CONTROLLER_KINDS}
_SUPPLY = "inverter.bus_voltage_V"
_GUESSED = 0.3  # tolerance of a guess, relative: 3 σ reach a tenth and twice of it
_SIMULATED_ALONE = ("motor.static_friction_Nm",)  # inverse dynamics leaves out rest, and sees nothing of it
_ENTRY = re.compile(r"\s*([^±,]*?)\s*(?:(?:±|\+-)\s*([^±,%]*?)\s*(%)?)?\s*(fixed)?\s*")


def entry_of(text: str, where: str) -> dict[str, Any]:
    """'1e-4 ± 5%', '0 +- 0.02', '3.5' or '3.5 fixed' as an entry of a file; InputError, which begins with `where`."""
    found = _ENTRY.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        value, sigma, percent, fixed = found.groups()
        entry: dict[str, Any] = {"value": float(value)}
        if sigma is not None:
            entry |= {"tolerance": float(sigma) / 100.0} if percent else {"sigma": float(sigma)}
        if fixed:
            entry["free"] = False
    except ValueError:
        raise InputError(
            f"{where}: write a number, or value±tolerance: 1e-4±5%, 0±0.02; not {quoted(text)!r}"
        ) from None
    return entry


def needed(controller: str, drive: str) -> tuple[str, ...]:
    """Every "section.parameter" that the file of an actuator of these kinds must say."""
    kinds = {"controller": controller, "inverter": drive}
    return tuple(f"{section}.{name}" for section in SECTIONS for name in layout(section, kinds)[0])


def asked(controller: str, drive: str) -> tuple[str, ...]:
    """What to ask of an actuator of these kinds, as "section.parameter"; the gear is always known to somebody.

    So is the supply of a duty, which a recording may have as well.
    """
    supply = (_SUPPLY,) if (controller, drive) == ("open", "voltage") else ()
    return tuple(dict.fromkeys(("transmission.gear_ratio", *supply, *needed(controller, drive))))


def unanswered(path: str, axes: Axes, controller: str = "") -> str:
    """What an answer left empty is taken for: 'guess 0.05', 'as if there were none'."""
    if controller == "open" and path == _SUPPLY:
        return "the recording's own, or a recorded motor voltage"
    guess = facts_of(path, axes).guess
    return "as if there were none" if guess == default_of(path) else f"guess {number(guess)}"


def number_of(text: str, where: str) -> float:
    """A number that no tolerance can be given of; InputError, which begins with `where`."""
    entry = entry_of(text, where)
    if len(entry) > 1:
        raise InputError(f"{where}: write a number without a tolerance, not {quoted(text)!r}")
    return entry["value"]


def gear_of(text: str, where: str) -> dict[str, Any]:
    """The user's motion per the motor's as an entry of a file.

    From '0.002', '1/500', '500:1', or '10 mm', which a screw moves in a turn; with a tolerance, '500:1 ± 1%'.
    InputError, which begins with `where`.
    """
    head = re.split(r"±|\+-|fixed", text.strip(), maxsplit=1)[0]
    tail = text.strip().removeprefix(head)
    head = head.strip()
    value = None
    if head.endswith("mm"):
        value = 1e-3 * number_of(head.removesuffix("mm"), where) / math.tau
    for mark, is_inverse in (("/", False), (":", True)):
        above, found, below = head.partition(mark)
        if found:
            one, other = (number_of(part, where) for part in (above, below))
            if not (one > 0.0 and other > 0.0):
                break
            value = other / one if is_inverse else one / other
    if value is None:
        return entry_of(text, where)
    entry = entry_of(f"{value!r} {tail}", where)
    if "sigma" in entry:
        raise InputError(f"{where}: write the tolerance of a ratio in %, as 500:1±1%; not {quoted(text)!r}")
    return entry


def described(
    document: Mapping[str, Any], controller: str, drive: str, where: str, sample_rate_Hz: float | None = None
) -> Actuator:
    """The actuator of these tables, as `actuator_of` reads them, with a guess for what they leave out.

    A value without a tolerance gets the usual one of its parameter, where it has one and a fit can learn of it.
    sample_rate_Hz: of its recordings, by which the model's step and the filter are chosen, as far as it is known.
    Raises InputError, which begins with `where`, for what no such actuator can have.
    """
    tables: dict[str, Any] = {name: dict(t) if isinstance(t, Mapping) else t for name, t in document.items()}
    tables.setdefault("controller", {})["kind"] = controller
    if says_drive(controller, drive):
        tables.setdefault("inverter", {})["kind"] = drive
    axes = actuator_axes(tables)
    every = [f"{section}.{name}" for section in SECTIONS for name in SECTIONS[section].__annotations__]
    given = [path for path in every if on_axes(path, axes).name in tables.get(path.partition(".")[0], {})]
    silent = unread(controller, drive)
    for path in given:
        entry = tables[path.partition(".")[0]][on_axes(path, axes).name]
        learned = path not in silent and not (controller == "unknown" and path in _SIMULATED_ALONE)
        if isinstance(entry, dict) and learned and not {"sigma", "tolerance", "free"} & set(entry):
            entry |= _usual_tolerance(path, axes, entry["value"])
    for path in sorted(needed(controller, drive), key=lambda path: bool(facts_of(path, axes).follows)):
        if path not in given:
            guess = _guess(tables, path, axes)
            alone = controller == "unknown" and path in _SIMULATED_ALONE
            _put(tables, path, axes, {"value": guess["value"]} if alone else guess)
    actuator = actuator_of(tables, where)
    said = tables.get("model", {})
    if controller == "unknown":
        return actuator if "filter_s" in said else replace(actuator, filter_s=usual_filter(sample_rate_Hz))
    return actuator if "step_s" in said else replace(actuator, step_s=usual_step(actuator, sample_rate_Hz))


def actuator_axes(tables: Mapping[str, Any]) -> Axes:
    """The axes of a description whose other tables may still be wrong."""
    given = tables.get("axes", {})
    return Axes(str(given.get("motor", "rotary")), str(given.get("user", "rotary")))


def is_guess(path: str, actuator: Actuator) -> bool:
    """Whether a parameter still has the value, and the tolerance, that are written where nobody knows it."""
    if path not in needed(actuator.controller.kind, actuator.inverter.kind) or facts_of(path, actuator.axes).follows:
        return False
    guess = _scaled_guess(path, actuator.axes, actuator.transmission.gear_ratio)
    if guess == default_of(path) or actuator.value(path) != guess:
        return False
    tolerance = actuator.tolerances.get(path)
    return tolerance is None or math.isclose(tolerance.sigma, _GUESSED * abs(guess))


def _guess(tables: Mapping[str, Any], path: str, axes: Axes) -> dict[str, Any]:
    facts = facts_of(path, axes)
    section, _, name = facts.follows.partition(".")
    leader = tables.get(section, {}).get(on_axes(facts.follows, axes).name) if name else None
    if leader is not None:
        return dict(leader) if "controller" not in path else {"value": leader["value"]}
    gear = tables.get("transmission", {}).get("gear_ratio", {}).get("value", 1.0)
    value = _scaled_guess(path, axes, gear)
    return {"value": value, "tolerance": _GUESSED} if facts.tolerance and value else {"value": value}


def _scaled_guess(path: str, axes: Axes, gear: float) -> float:
    """A position gain is from the user's error to the motor's speed, and so counts the gear in."""
    return facts_of(path, axes).guess / (gear if path == "controller.position_gain_1_s" else 1.0)


def _put(tables: dict[str, Any], path: str, axes: Axes, entry: dict[str, Any]) -> None:
    tables.setdefault(path.partition(".")[0], {})[on_axes(path, axes).name] = entry


def _usual_tolerance(path: str, axes: Axes, value: float) -> dict[str, float]:
    facts = facts_of(path, axes)
    if facts.tolerance and value:
        return {"tolerance": facts.tolerance}
    return {"sigma": facts.sigma} if facts.sigma else {}

"""One actuator: its parameters with tolerances, effects and faults; the steps of its models; what faults mean in it."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator.parameters import (
    SECTIONS,
    Controller,
    Inverter,
    Motor,
    Rule,
    Sensors,
    Tolerance,
    Transmission,
    check_stops,
    check_value,
    check_value_is_read,
    default_of,
    idle,
    numbers,
    on_axes,
    unread,
)
from ema_model.errors import InputError, quoted
from ema_model.faults import physical, vector
from ema_model.quantities import USER, Axes, Quantity, with_uncertainty

# --- one actuator: its parameters with their tolerances, its effects and its known faults -----------------------------

CURRENT_INPUTS = ("current_A", "motor_torque_Nm")  # what an open loop is driven by, the first of them that there is
VOLTAGE_INPUTS = ("motor_voltage_V", "duty")  # the same with a voltage drive
_OPEN_STEP_S = 5e-5  # what an actuator without chopping is simulated with
_LEARNED = 0.9  # of a tolerance: a fit that leaves more of it learned nothing of the parameter
_FITTED = "The sigma of each fitted parameter is 1 σ of what the fit found; its 90 % interval is value ± 1.645 sigma."


@dataclass(frozen=True)
class Actuator:
    """All parameters of one actuator; SI units, which the names say (for linear axes see `quantities`).

    Its faults are the known state of this unit: what simulates it (a run, a comparison, a discovery) starts from
    them unless it is told another k.  An identification does not: its k counts from the healthy actuator, so that a
    worn unit is found worn, whatever its file says.
    """

    name: str
    controller: Controller
    inverter: Inverter
    motor: Motor
    transmission: Transmission
    sensors: Sensors
    tolerances: dict[str, Tolerance] = field(default_factory=dict)  # by "section.parameter"
    description: str = ""
    effects: dict[str, dict[str, float]] = field(default_factory=dict)  # that belong to its model
    faults: dict[str, float] = field(default_factory=dict)  # k1 … k8 that are known; the others are healthy
    axes: Axes = field(default_factory=Axes)
    step_s: float = 1e-5  # of the Monitor Model
    filter_s: float = 12e-3  # half width over which a measured motion is differentiated, for inverse dynamics
    leaves_out_reversals: bool = False  # and the slow parts of strokes, where friction's law is not known
    torque_known: bool = True  # whether the torque constant is known, so that currents can be told as torques
    mapping: tuple[str, ...] = ()  # of its recordings' columns, as for --map
    rules: tuple[Rule, ...] = ()
    text: str = field(default="", compare=False, repr=False)  # of its file, whose comments stay when it is saved
    note: str = field(default="", compare=False, repr=False)  # a comment for the head of its file

    @property
    def has_reference_model(self) -> bool:
        """Whether it is the kind that the three-phase Reference Model describes."""
        return self.controller.kind == "cascade" and self.inverter.kind == "hysteresis"

    @property
    def has_one_clock(self) -> bool:
        """Whether what is put in and what is measured stand at the moments that a log says, but for sensors' delays.

        A digital drive's bus carries a command before or after the sample that it is logged in.
        """
        return self.has_reference_model or self.controller.kind == "open"

    @property
    def k(self) -> NDArray[np.float64]:
        """The known faults with the healthy ones, (8,)."""
        return vector(self.faults)

    @property
    def current_limit_A(self) -> Any:
        """The most current, A, that controller and drive allow; (n,) where one of them is."""
        return np.minimum(self.controller.current_limit_A, self.inverter.current_limit_A)

    @property
    def takes_voltage(self) -> bool:
        """Whether a recorded voltage, or a duty, is put in."""
        return self.controller.kind == "open" and self.inverter.kind == "voltage"

    def in_open_loop(self, recorded: Container[str] = ()) -> Actuator:
        """The same without a controller, and without what acts in it: what a recording has is put in.

        That is its current or torque, and the drive is gone as well; with a voltage drive, where of these there is
        none, or the actuator's file is of an open loop, it is its motor voltage or duty.  recorded: its signals.
        An actuator whose controller is not known has no play and end stops in its file, and so none here.
        """
        is_driven = self.takes_voltage or not any(name in recorded for name in CURRENT_INPUTS)
        takes_voltage = self.inverter.kind == "voltage" and any(name in recorded for name in VOLTAGE_INPUTS)
        drive = "voltage" if takes_voltage and is_driven else "current"
        gone = unread("open", drive)
        neutral = {path: default_of(path) for path in gone if not path.startswith(("controller.", "inverter."))}
        inverter = replace(self.inverter, current_limit_A=math.inf) if drive == "voltage" else Inverter(kind="current")
        bare = replace(self, controller=Controller(kind="open"), inverter=inverter).varied(neutral)
        usual = {"filter_s": Actuator.filter_s, "leaves_out_reversals": Actuator.leaves_out_reversals}
        step_s = self.step_s if drive == "voltage" else max(self.step_s, _OPEN_STEP_S)
        return replace(bare._as_read(), step_s=step_s, **usual)

    def without_controller(self) -> Actuator:
        """The same for inverse dynamics: a measured motion is put in, and the current that it needs comes out.

        It leaves out what is about reversals, as its answer stands in for a closed loop's.
        """
        controller = replace(self.controller, kind="unknown")
        return replace(self, controller=controller, step_s=Actuator.step_s, leaves_out_reversals=True)._as_read()

    def _as_read(self) -> Actuator:
        """Without effects that do nothing where its kind of controller is, and what is said of parameters not read."""
        from ema_model.effects import find  # the catalogue need not be loaded for an actuator without effects

        kinds = self.controller.kind, self.inverter.kind
        gone = unread(*kinds)
        places = {name: {place.__name__ for place in find(name).places} for name in self.effects}
        effects = {
            name: given
            for name, given in self.effects.items()
            if not idle(places[name], bool(find(name).states), *kinds)
        }
        kept = {
            path: one
            for path, one in self.tolerances.items()
            if path not in gone and (not path.startswith("effects.") or path.split(".")[1] in effects)
        }
        rules = tuple(
            replace(one, values={path: value for path, value in one.values.items() if path not in gone})
            for one in self.rules
        )
        return replace(self, tolerances=kept, effects=effects, rules=rules)

    def circuit(self, preferred: str = "reduced") -> str:
        """The Monitor Model's drive; `preferred` is the circuit for the hysteresis current loop."""
        return preferred if self.inverter.kind == "hysteresis" else self.inverter.kind

    def value(self, path: str) -> float:
        """The value of "section.parameter", or of "effects.name.parameter"."""
        section, *names = path.split(".")
        if section == "effects":
            return float(self.effects[names[0]][names[1]])
        return float(getattr(getattr(self, section), names[0]))

    def with_values(self, values: dict[str, float]) -> Actuator:
        """A copy with some "section.parameter" changed; InputError for an impossible value."""
        changed = self
        for path, value in values.items():
            section, _, name = path.partition(".")
            if section == "effects":
                changed = changed.varied({path: float(value)})
                continue
            if section not in SECTIONS or name not in numbers(section):
                raise InputError(
                    f"no actuator parameter {quoted(path)!r}; write it as section.name, e.g. motor.inertia_kgm2"
                )
            check_value(section, name, value, "actuator", on_axes(path, changed.axes).name)
            check_value_is_read(changed.controller.kind, changed.inverter.kind, changed.axes, path, value, "actuator")
            changed = changed.varied({path: float(value)})
        check_stops(changed.transmission, changed.axes, "actuator")
        return changed

    def varied(self, values: dict[str, Any]) -> Actuator:
        """A copy with values set unchecked; they may be arrays (n,), one value for each run of a population."""
        sections: dict[str, Any] = {}
        for path, value in values.items():
            section, *names = path.split(".")
            if section == "effects":
                effects = sections.setdefault("effects", {name: dict(given) for name, given in self.effects.items()})
                effects[names[0]][names[1]] = value
            else:
                sections[section] = replace(sections.get(section, getattr(self, section)), **{names[0]: value})
        return replace(self, **sections)

    def with_fitted_sigmas(self, sigmas: Mapping[str, float]) -> Actuator:
        """A copy whose tolerances are the σ that a fit found, by path: the prior of the next fit.

        A parameter keeps its tolerance where the fit learned nothing of it, or where its σ is no number above 0.
        """
        narrowed = {
            path: replace(one, sigma=float(sigma))
            for path, one in self.tolerances.items()
            if (sigma := sigmas.get(path)) is not None and math.isfinite(sigma) and 0.0 < sigma < _LEARNED * one.sigma
        }
        return replace(self, tolerances={**self.tolerances, **narrowed}, note=_FITTED if narrowed else self.note)

    def for_recording(self, name: str) -> Actuator:
        """The actuator as it was in the recording of that name (`rules`)."""
        values = {path: value for rule in self.rules_for(name) for path, value in rule.values.items()}
        return self.with_values(values) if values else self

    def rules_for(self, name: str) -> tuple[Rule, ...]:
        """The rules that hold for a recording of that name, or for the file that it is a run of: NAME#3."""
        names = (name, name.rpartition("#")[0])
        return tuple(rule for rule in self.rules if any(one and fnmatchcase(one, rule.match) for one in names))


# --- how long the model's steps and the filter of a measured motion are: by the drive, its loop and the sampling ------

SHORTEST_S, LONGEST_S = 1e-7, 1.0  # that a file may say
_STEPS_A_PERIOD = 50.0  # of the loop's own oscillation
_LONGEST_STEP_S = 5e-4  # of a position loop: friction lets go and catches at a step
_COARSEST_STEP_S, _COARSEST_SHARE = 1e-4, 0.05  # or of a sample's period, whichever is longer
_SAMPLES_A_FILTER = 3.0  # to either side, over which a measured motion is differentiated at least


def reader_step(controller: str, inverter: str) -> float:
    """The step, s, of a file that says none.

    Chopping takes steps of 10 µs; of a drive that has its current at once, only the motion is simulated.
    """
    return 5e-5 if inverter == "current" and controller != "unknown" else Actuator.step_s


def usual_filter(sample_rate_Hz: float | None) -> float:
    """Half width, s, over which a measured motion is differentiated: the reader's own, and three samples at least."""
    least_s = float(f"{_SAMPLES_A_FILTER / sample_rate_Hz:.3g}") if sample_rate_Hz else 0.0
    return min(max(Actuator.filter_s, least_s), LONGEST_S)


def usual_step(actuator: Actuator, sample_rate_Hz: float | None = None) -> float:
    """The step, s, that an actuator with a simulated loop needs.

    A position loop takes fifty steps in a period of its fastest motion, and 0.5 ms at most; what the reader takes for
    the other kinds is the most for them, and a speed loop needs fifty steps, too.  1, 2 or 5 · 10ⁿ s, 10 µs at least.
    No step is longer than what recordings of that rate are simulated with.
    """
    controller, inverter = actuator.controller.kind, actuator.inverter.kind
    is_slow = controller == "position" or actuator.takes_voltage
    longest = _LONGEST_STEP_S if is_slow else reader_step(controller, inverter)
    rate = loop_rate(actuator)
    if rate > 0.0:
        longest = min(longest, math.tau / (_STEPS_A_PERIOD * rate))
    if sample_rate_Hz:
        longest = min(longest, coarsest_step(1.0 / sample_rate_Hz))
    power = 10.0 ** math.floor(math.log10(longest) + 1e-9)
    digit = max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= longest * (1.0 + 1e-9))
    return max(Actuator.step_s, float(f"{digit * power:.0e}"))


def coarsest_step(period_s: float) -> float:
    """The longest step, s, that recordings with a sample every period_s are simulated with.

    Where something sticks, it does so at a step: with coarser ones the error is too rough to go downhill on (fits of a
    hobby servo, a sample every 2 ms, ended up to 300 apart in χ² with steps of 0.5 ms, within 40 with 0.1 ms).
    """
    return max(_COARSEST_STEP_S, _COARSEST_SHARE * period_s)


def loop_rate(actuator: Actuator) -> float:
    """The fastest rate of the closed loop on its inertia, 1/s; 0 where nothing is closed.

    Of a cascade that of the speed loop, K_P/J.  Of a position loop the oscillation √(g τ T/J), where the gain g asks
    for the drive's greatest torque T, or the decay (B + k_t²/R)/J with a voltage drive, whichever is faster; of a
    voltage that is put in the decay alone.
    """
    motor, controller, inverter = actuator.motor, actuator.controller, actuator.inverter
    if controller.kind == "cascade":
        return controller.speed_gain_Nms_rad / motor.inertia_kgm2
    if controller.kind != "position" and not actuator.takes_voltage:
        return 0.0
    most = float(inverter.current_limit_A) * motor.torque_constant_Nm_A
    decay = motor.viscous_friction_Nms_rad
    if inverter.kind == "voltage":
        most = inverter.bus_voltage_V / motor.resistance_Ohm * motor.torque_constant_Nm_A
        decay += motor.torque_constant_Nm_A**2 / motor.resistance_Ohm
    stiffness = controller.gain_1_rad * actuator.transmission.gear_ratio * most * controller.output_limit
    return max(math.sqrt(stiffness / motor.inertia_kgm2), decay / motor.inertia_kgm2)


# --- what fault parameters mean in one actuator, as an engineer reads them --------------------------------------------


def readings(k: ArrayLike, actuator: Actuator) -> dict[str, float]:
    """One k as the physical values that an engineer reads, units in the names."""
    p = physical(k)
    return {
        "friction_factor": float(p.friction_factor),
        _backlash(actuator): float(p.backlash_factor * actuator.transmission.backlash_rad),
        "turns_a": float(p.turns[0]),
        "turns_b": float(p.turns[1]),
        "turns_c": float(p.turns[2]),
        "eccentricity": float(p.eccentricity),
        "eccentricity_phase_rad": float(p.phase_rad),
        "position_gain_1_s": float(p.gain_factor * actuator.controller.position_gain_1_s),
    }


def between(k: ArrayLike, interval: ArrayLike, actuator: Actuator) -> tuple[str, ...]:
    """k (8,) and its interval (8, 2) as values in physical units, one phrase for each: 'friction × 1.60 ± 0.02'."""
    k, ends = np.asarray(k, dtype=float), np.asarray(interval, dtype=float).T
    p, low, high = physical(k), physical(ends[0]), physical(ends[1])
    play = actuator.transmission.backlash_rad
    unit = actuator.axes.unit("rad", USER)
    half = 0.5 * play * abs(float(high.backlash_factor) - float(low.backlash_factor))
    phrases = [
        f"friction × {_within(p.friction_factor, low.friction_factor, high.friction_factor)}",
        f"backlash {with_uncertainty(play * float(p.backlash_factor), half, unit)}",
    ]
    for phase, *values in zip("ABC", p.turns, low.turns, high.turns):
        phrases.append(f"phase {phase}: {_within(*(100.0 * float(one) for one in values))} % of turns")
    phrases.append(f"eccentricity ζ = {_within(p.eccentricity, low.eccentricity, high.eccentricity)}")
    angles = [float(np.degrees(one)) for one in (p.phase_rad, low.phase_rad, high.phase_rad)]
    phrases.append(f"thinnest gap at {_within(*angles)}°")
    phrases.append(f"gain × {_within(p.gain_factor, low.gain_factor, high.gain_factor)}")
    return tuple(phrases)


def _within(value: ArrayLike, low: ArrayLike, high: ArrayLike) -> str:
    """'1.60 ± 0.02': half the width with two digits, the value with as many decimals."""
    at, bottom, top = (float(np.asarray(one)) for one in (value, low, high))
    half = 0.5 * abs(top - bottom)
    decimals = 3 if half < 5e-4 else min(3, max(0, 1 - int(np.floor(np.log10(half)))))
    return f"{at:.{decimals}f} ± {max(half, 0.5 * 10.0**-decimals):.{decimals}f}".replace("-", "−")


def _backlash(actuator: Actuator) -> str:
    return actuator.axes.name("backlash_rad", USER)


def _play(value: float, unit: str) -> str:
    """'703 µrad', as an interval has it, in place of 0.703 mrad."""
    shown = Quantity("", unit).scaled(value)
    return (Quantity("", unit).scaled(1e-3 * value) if shown.factor * value < 1.0 else shown).text(value)


def _direction(phase_rad: float) -> str:
    """'+72', '0'."""
    degrees = round(np.degrees(phase_rad))
    return f"{degrees:+d}".replace("-", "−") if degrees else "0"


def sentences(k: ArrayLike, actuator: Actuator) -> tuple[str, ...]:
    """The same as eight short phrases, one for each k."""
    r = readings(k, actuator)
    return (
        f"friction × {r['friction_factor']:.2f}",
        f"backlash {_play(r[_backlash(actuator)], actuator.axes.unit('rad', USER))}",
        f"phase A: {100.0 * r['turns_a']:.0f} % of turns",
        f"phase B: {100.0 * r['turns_b']:.0f} % of turns",
        f"phase C: {100.0 * r['turns_c']:.0f} % of turns",
        f"eccentricity ζ = {r['eccentricity']:.2f}",
        f"thinnest gap at {_direction(r['eccentricity_phase_rad'])}°",
        f"gain × {physical(k).gain_factor:.2f}",
    )

"""One actuator: its parameters with their tolerances, its effects and its known faults."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator.naming import on_axes
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
    default_of,
    numbers,
)
from ema_model.actuator.unread import check_value_is_read, idle, unread
from ema_model.errors import InputError, quoted
from ema_model.faults import vector
from ema_model.quantities.axes import Axes

CURRENT_INPUTS = ("current_A", "motor_torque_Nm")  # what an open loop is driven by, the first of them that there is
VOLTAGE_INPUTS = ("motor_voltage_V", "duty")  # the same with a voltage drive
_OPEN_STEP_S = 5e-5  # what an actuator without chopping is simulated with
_LEARNED = 0.9  # of a tolerance: a fit that leaves more of it learned nothing of the parameter
_FITTED = "The sigma of each fitted parameter is 1 σ of what the fit found; its 90 % interval is value ± 1.645 sigma."


@dataclass(frozen=True)
class Actuator:
    """All parameters of one actuator; SI units, which the names say (for linear axes see `quantities.axes`).

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

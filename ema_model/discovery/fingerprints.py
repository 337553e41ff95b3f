"""Fingerprints: what each effect would change in the signals, for all of them in one population.

They share one stack, in which every lane has one of them on and all others do nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import idle
from ema_model.effects import Effect, find
from ema_model.effects.effect import USER
from ema_model.estimation.model_fit import Data, Fit
from ema_model.models import Model

Array = NDArray[np.float64]
Lane = tuple[Effect, dict[str, float]]
Ranges = Mapping[str, tuple[float, float]]  # by variable

_FAR = 10.0  # times what there is to explain
_ATTEMPTS = 6
_LONGEST_STEP_S = 2e-5  # at which no score differs in its first three digits from that at 1e-5
_BACKWARD = 0.05  # of the top speed, that both directions must reach for motion to count as both ways
_DIVERGED = 1e100  # floors, from which on a change has no meaning: its square would overflow


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """What an effect with these settings changes, over the floor: (values, columns).

    Two columns are the two phases of a periodic effect, or those after the first what other linear parameters do at
    these values, `beside`.  Of an effect that the file has they are what its own parameters do beyond their tolerances.
    """

    name: str
    settings: dict[str, float]
    columns: Array
    beside: dict[str, float] = field(default_factory=dict)
    frees: tuple[str, ...] = ()  # the calibrated parameters of the file's effect, whose columns they are


def variants(
    effect: Effect, orders: Sequence[float], top_rad_s: float = 0.0, ranges: Ranges | None = None, gear: float = 1.0
) -> list[list[dict[str, float]]]:
    """Settings to try; those of one entry are columns of one fingerprint: of a phase, its sine and cosine.

    top_rad_s: the motor's top speed, and gear what the user moves by it; ranges: of the variables, for effects that
    begin at a place along one.
    """
    names = [parameter.name for parameter in effect.parameters]
    first = effect.parameters[0].name
    middle = effect.severities[1]
    if "phase_rad" in names and "order" in names:
        low, high = next((one.low, one.high) for one in effect.parameters if one.name == "order")
        return [
            [{first: middle, "order": float(order), "phase_rad": phase} for phase in (0.0, 0.5 * np.pi)]
            for order in orders
            if low <= order <= high
        ]
    if effect.phase:
        return [[{first: middle, effect.phase: phase} for phase in (0.0, 0.5 * np.pi)]]
    if effect.placed:
        low, high = (ranges or {}).get(effect.against, (0.0, 0.0))
        own = {one.name: one for one in effect.parameters}
        places = [
            {name: low + s * (high - low) for name, s in zip(effect.placed, at)} for at in zip(*effect.placed.values())
        ]
        within = [at for at in places if all(own[name].low <= value <= own[name].high for name, value in at.items())]
        return [[{first: middle, **place}] for place in within] if high > low else []
    low, high = effect.parameters[0].low, effect.parameters[0].high
    top = top_rad_s * (gear if effect.parameters[0].side == USER else 1.0)
    speeds = [share * top for share in effect.at_speeds]
    beside = [{first: effect.nothing, name: value} for name, value in _beside(effect).items()]
    usual = (*effect.severities, *(speed for speed in speeds if low <= speed <= high))
    return [[{first: one}, *beside] for one in usual]


def _beside(effect: Effect) -> dict[str, float]:
    """Values at which one looks at what an effect's other linear parameters do."""
    return {one.name: effect.beside[one.name] * one.high for one in effect.parameters if one.name in effect.beside}


def fingerprints(data: Data, found: Fit, names: Iterable[str], orders: Sequence[float]) -> list[Fingerprint]:
    """Those of all effects that are not yet in the model, at the model's calibrated parameters."""
    effects = [find(name, found.actuator.axes) for name in names if name not in found.effects]
    if not moves_both_ways(found):
        effects = [one for one in effects if not one.by_direction]
    top, ranges, gear = top_speed(found), ranges_of(found), found.calibration.actuator.transmission.gear_ratio
    tried = [(effect, settings) for effect in effects for settings in variants(effect, orders, top, ranges, gear)]
    lanes = [(effect, one) for effect, settings in tried for one in settings]
    if not lanes:
        return []
    change = _changes(data, found, lanes)
    for _ in range(1, _ATTEMPTS):
        with np.errstate(over="ignore"):  # a loop that an effect makes unstable
            size = np.sqrt(np.mean(change**2, axis=1))
        gentle = [_gentler(effect, one, s, found.error()) for (effect, one), s in zip(lanes, size)]
        again = [lane for lane, new in enumerate(gentle) if new is not None]
        if not again:
            break
        lanes = [(effect, new or one) for (effect, one), new in zip(lanes, gentle)]
        change[again] = _changes(data, found, [lanes[lane] for lane in again])
    prints, lane = [], 0
    for effect, settings in tried:
        columns = change[lane : lane + len(settings)].T
        columns = np.where(np.abs(columns) < _DIVERGED, columns, 0.0)  # also NaN
        own = [one for _, one in lanes[lane : lane + len(settings)]]
        beside = {name: one[name] for one in own[1:] for name in effect.beside if name in one}
        prints.append(Fingerprint(effect.name, dict(own[0]), columns, beside))
        lane += len(settings)
    return prints


def of_the_file(found: Fit, names: Iterable[str]) -> list[Fingerprint]:
    """Those of effects that the file has, as far as their parameters are free: what they would do beyond it."""
    calibration = found.calibration
    columns = [*calibration.parameters, *calibration.starts]
    prints = []
    for name in names:
        own = tuple(path for path in calibration.parameters if path.startswith(f"effects.{name}."))
        if own:
            jacobian = calibration.weighted_jacobian[:, [columns.index(path) for path in own]]
            prints.append(Fingerprint(name, dict(calibration.actuator.effects[name]), jacobian, frees=own))
    return prints


def _changes(data: Data, found: Fit, lanes: list[Lane]) -> Array:
    """What each lane's effect changes, over the floor: (lanes, values).

    Only what the drive does within a step of its own needs the model's shortest steps.
    """
    of_drive = np.array([effect.family == "drive" for effect, _ in lanes])
    parts = [(np.flatnonzero(of_drive), 0.0), (np.flatnonzero(~of_drive), _LONGEST_STEP_S)]
    changes = [_changed(data, found, lanes, rows, longest_s) for rows, longest_s in parts if len(rows)]
    return np.concatenate(changes)[np.argsort(np.concatenate([rows for rows, _ in parts]))]


def _changed(data: Data, found: Fit, lanes: list[Lane], rows: NDArray[np.intp], longest_s: float) -> Array:
    """The same for some of the lanes, by their place, at steps of up to longest_s."""
    actuator: Actuator = found.calibration.actuator
    resting = {effect.name: effect.neutral for effect, _ in lanes} | actuator.effects
    varied = {
        name: {parameter: np.full(len(rows) + 1, value) for parameter, value in values.items()}
        for name, values in resting.items()
    }
    for lane, row in enumerate(rows, 1):
        effect, settings = lanes[row]
        for parameter, value in effect.settings(settings).items():
            varied[effect.name][parameter][lane] = value
    plant = data.plant(replace(actuator, effects=resting)).at_longer_steps(longest_s)
    model = replace(actuator, effects=varied)
    k = np.tile(found.calibration.k, (len(rows) + 1, 1))
    shown = [plant.signals(i, model, k, *found.calibration.start_of(i)) for i in range(len(plant.windows))]
    signals = data.over_floor(plant, shown)
    return signals[1:] - signals[0]


def _gentler(effect: Effect, settings: dict[str, float], size: float, error: float) -> dict[str, float] | None:
    """Settings that change about as much as there is to explain, where these change far more (another actuator's)."""
    first = effect.parameters[0]
    if size <= _FAR * max(1.0, error) or first.low > 0.0:
        return None
    share = max(2.0 * max(1.0, error) / size, 1e-4) if np.isfinite(size) else 1e-3
    amounts = {first.name, *effect.beside}
    return {name: share * value if name in amounts else value for name, value in settings.items()}


def may_act(name: str, actuator: Actuator) -> bool:
    """Whether an effect is of something that is there: of a drive only where its controller is simulated.

    One that a fault stands for is not looked for beside the faults.
    """
    effect = find(name)
    if not effect.has_part(actuator.axes) or (effect.fault and actuator.has_reference_model):
        return False
    kinds = actuator.controller.kind, actuator.inverter.kind
    places = {function.__name__ for function in effect.places}
    return effect.family != "drive" or not idle(places, bool(effect.states), *kinds)


# --- how far a fitted model's recordings go: greatest values, the top speed, the travel -------------------------------


def greatest(found: Fit, signal: str) -> float:
    """The greatest size of a signal; 0 where it is not known."""
    shown = [signals[signal] for signals in found.calibration.signals if signal in signals]
    return float(max((np.max(np.abs(one)) for one in shown), default=0.0))


def travel(found: Fit) -> float:
    """What the motor turns, rad; infinite where it is not known."""
    shown = [signals["motor_position_rad"] for signals in found.calibration.signals if "motor_position_rad" in signals]
    return float(max((np.ptp(one) for one in shown), default=np.inf))


def top_speed(found: Fit) -> float:
    """The motor's top speed, rad/s; 0 where it is not known."""
    return float(max((np.max(np.abs(one)) for one in _speeds(found)), default=0.0))


def moves_both_ways(found: Fit) -> bool:
    """Whether the motor goes forward and backward; also where its speed is not known."""
    speeds = _speeds(found)
    if not speeds:
        return True
    fastest = top_speed(found)
    return all(max(float(np.max(side * one)) for one in speeds) > _BACKWARD * fastest for side in (1.0, -1.0))


def ranges_of(found: Fit) -> Ranges:
    """What the user's position goes through, and how fast the motor turns from standstill on, where it is known."""
    user, tau = [], found.actuator.transmission.gear_ratio
    top = top_speed(found)
    ranges = {"motor_speed": (0.0, top)} if top > 0.0 else {}
    for window, signals in zip(found.plant.windows, found.calibration.signals):
        motor = signals.get("motor_position_rad", window.context.get("motor_position_rad"))
        shown = signals.get("user_position_rad", None if motor is None else tau * motor)
        user += [] if shown is None else [np.min(shown), np.max(shown)]
    return ranges | ({"user_position": (float(min(user)), float(max(user)))} if user else {})


def _speeds(found: Fit) -> list[Array]:
    """The motor's speed in each window where it is known, (blocks,)."""
    windows = zip(found.plant.windows, found.calibration.signals)
    shown = [window.context.get("motor_speed_rad_s", signals.get("motor_speed_rad_s")) for window, signals in windows]
    return [one for one in shown if one is not None]


# --- What one more effect with given settings would change in a fitted model, before any refit ------------------------

_LEAST = 1e-9  # σ, so that a parameter at its bound has some room


@dataclass(frozen=True, eq=False)
class Preview:
    """A fitted model with room for one effect; the first change with it is compiled."""

    data: Data
    found: Fit
    name: str
    plant: Model
    jacobian: Array  # ∂residual/∂x, (values, unknowns), above the prior's, (unknowns, unknowns)
    basis: Array  # its Q, (values + unknowns, unknowns)
    triangle: Array  # and R

    def change(self, settings: Mapping[str, float]) -> Array:
        """What the effect would take from measured − model, over the floor: (values,); NaN where it has no value.

        The calibrated parameters follow, as far as a straight line tells: some may have stood in for it.
        """
        calibration = self.found.calibration
        model = _with(calibration.actuator, self.name, settings)
        after = [
            self.plant.signals(i, model, calibration.k, *calibration.start_of(i))
            for i in range(len(self.plant.windows))
        ]
        whole = self.data.over_floor(self.plant, after)[0] - self.data.over_floor(self.found.plant, calibration.signals)
        return whole + self._followed(whole) if np.all(np.isfinite(whole)) else whole

    def _followed(self, change: Array) -> Array:
        """What the parameters change in turn, within their bounds and their prior: (values,)."""
        calibration = self.found.calibration
        wanted = -self.basis.T @ np.concatenate([calibration.residual + change, calibration.x])
        low, high = calibration.room
        room = np.minimum(low, -_LEAST), np.maximum(high, _LEAST)
        moved = lsq_linear(self.triangle, wanted, room, method="bvls").x
        return self.jacobian[: len(change)] @ moved


def preview(data: Data, found: Fit, name: str, settings: Mapping[str, float]) -> Preview:
    """Makes room for an effect beside those of a fit; its settings may change afterwards."""
    calibration = found.calibration
    jacobian = np.concatenate([calibration.weighted_jacobian, np.eye(len(calibration.x))])
    basis, triangle = np.linalg.qr(jacobian)
    plant = data.plant(_with(calibration.actuator, name, settings))
    return Preview(data, found, name, plant, jacobian, basis, triangle)


def _with(actuator: Actuator, name: str, settings: Mapping[str, float]) -> Actuator:
    return replace(actuator, effects={**actuator.effects, name: dict(settings)})

"""The least-squares problem of every fit: unknowns with their priors, a model that simulates them, weights."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import low_limit, on_axes
from ema_model.effects import find
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.estimation.noise import POSITIONS, SPEED, Floor
from ema_model.faults import NAMES
from ema_model.models import Model, Window
from ema_model.models.closed_loop import LOAD
from ema_model.models.measured_motion import later
from ema_model.models.model import Effects, Signals
from ema_model.physics.rows import LANES
from ema_model.side_by_side import windows

# --- what a fit may move: parameters of the actuator and of effects, faults, starts, loads that were not recorded -----
# Each is counted in σ of what is known about it beforehand, its prior.  The eccentricity is moved as the vector
# k6·(cos φ, sin φ), φ = 2π(k7 − ½), whose parts stand in the places of k6 and k7: its angle has no ends, and none
# where k6 = 0, so that a fit neither stops at k7 = 0 or 1 nor is caught by a k7 that was wrong while k6 was small.

Array = NDArray[np.float64]

BOUND = 3.0  # σ
STARTS = ("turned", "play", "faster", "pull")  # kinds of unknowns, in the order in which `Model.signals` takes them
# 1 σ of each k, and of each part of the eccentricity, about the actuator's own.  A k may be anywhere in [0, 1], so the
# prior is wide: what recordings do not tell is as the file says rather than anything, what they tell outweighs it.
K_SIGMA = 0.5
ECCENTRICITY = (5, 6)  # places of its parts among the faults
_STEP = 0.1  # σ, of the differences: beyond the roughness that stick and slip give
_STEP_OF_K = 0.01  # of a k's, which spans far more
_TURNED_RAD = 2e-3  # how well a rig's encoder tells where the motor starts
_WIDEST_PLAY = 50.0  # half plays, of a worn actuator
_LEAST_START_RAD = 1e-6
_UNRECORDED_LOAD = 0.05  # 1 σ of a load that was not recorded, of the motor's greatest torque


@dataclass(frozen=True)
class Unknown:
    """One number that a fit moves: nominal + σ·x, low ≤ x ≤ high; σ is its prior."""

    name: str  # "section.parameter", "effects.name.parameter", k1…k8; or kind and place: "turned 0", "lag 0"
    nominal: float
    sigma: float
    low: float = -BOUND
    high: float = BOUND
    kind: Literal["parameter", "fault", "turned", "play", "faster", "pull", "load", "lag"] = "parameter"
    place: int = 0  # of a fault: which; of a start: its window; of a load and of a lag: its recording
    step: float = _STEP  # of the difference that a derivative is taken by

    @property
    def is_base(self) -> bool:
        """Whether it is a parameter of the actuator's file, and none of an effect."""
        return self.kind == "parameter" and not self.name.startswith("effects.")

    @property
    def is_scale(self) -> bool:
        """Whether it is a positive quantity, which acts by its ratios: a resistance, an inertia, a gain."""
        return self.kind == "parameter" and self.nominal > 0.0 and self.nominal + self.sigma * self.low > 0.0


def to_vector(k: ArrayLike) -> Array:
    """k (…, 8) → the same with the eccentricity's vector in place of k6 and k7."""
    vector = np.array(k, dtype=float)
    phase = 2.0 * np.pi * (vector[..., 6] - 0.5)
    vector[..., 5], vector[..., 6] = vector[..., 5] * np.cos(phase), vector[..., 5] * np.sin(phase)
    return vector


def to_k(vector: ArrayLike) -> Array:
    """The inverse, (…, 8), inside its bounds, k7 in [0, 1); a centred rotor has k7 = ½."""
    vector = np.asarray(vector, dtype=float)
    k = np.clip(vector, 0.0, 1.0)
    a, b = vector[..., 5], vector[..., 6]
    k[..., 5] = np.clip(np.hypot(a, b), 0.0, 1.0)
    k[..., 6] = np.mod(np.arctan2(b, a) / (2.0 * np.pi) + 0.5, 1.0)
    return k


def polar(vector: Array, covariance: Array) -> tuple[float, float, float]:
    """σ along and across the eccentricity's vector (2,), with its covariance (2, 2), and its length."""
    length = float(np.hypot(*vector))
    if length < 1e-9:
        both = float(np.sqrt(np.trace(covariance) / 2.0))
        return both, both, length
    along = vector / length
    across = np.array([-along[1], along[0]])
    return float(np.sqrt(along @ covariance @ along)), float(np.sqrt(across @ covariance @ across)), length


def unknowns_of(actuator: Actuator, names: Iterable[str]) -> list[Unknown]:
    """The unknowns for "section.parameter", "effects.name.parameter" or k1…k8; k6 and k7 move together.

    Raises InputError for one without a tolerance, since nothing says how far it may go.
    """
    both = NAMES[ECCENTRICITY[0]], NAMES[ECCENTRICITY[1]]
    wanted = dict.fromkeys(one for name in names for one in (both if name in both else (name,)))
    return [_fault(actuator, NAMES.index(one)) if one in NAMES else _parameter(actuator, one) for one in wanted]


def _fault(actuator: Actuator, place: int) -> Unknown:
    nominal = float(to_vector(actuator.k)[place])
    least = -1.0 if place in ECCENTRICITY else 0.0
    low, high = (least - nominal) / K_SIGMA, (1.0 - nominal) / K_SIGMA
    return Unknown(NAMES[place], nominal, K_SIGMA, low, high, "fault", place, _STEP_OF_K)


def _parameter(actuator: Actuator, name: str) -> Unknown:
    if name not in actuator.tolerances:
        known = [on_axes(path, actuator.axes).path for path in actuator.tolerances]
        raise InputError(
            f"{quoted(name)} cannot be calibrated: the actuator's file gives it no tolerance; "
            f"free may be {', '.join(known)}{did_you_mean(name, [*NAMES, *known])}"
        )
    nominal, sigma = actuator.value(name), actuator.tolerances[name].sigma
    low, high = physical_limits(name, actuator)
    # Zero itself is no inertia.
    low = low + 1e-3 * abs(nominal) if low == 0.0 else low
    below, above = (_room_to_limit(limit, nominal) / sigma for limit in (low, high))
    return Unknown(name, nominal, sigma, max(-BOUND, -below), min(BOUND, above))


def physical_limits(name: str, actuator: Actuator) -> tuple[float, float]:
    """Between which "section.parameter", "effects.name.parameter" or k1…k8 has a meaning, in its unit."""
    if name in NAMES:
        return (-math.inf, math.inf) if NAMES.index(name) in ECCENTRICITY else (0.0, 1.0)
    if name.startswith("effects."):
        _, effect, parameter = name.split(".")
        return next((p.low, p.high) for p in find(effect, actuator.axes).parameters if p.name == parameter)
    return (low_limit(name, actuator.has_one_clock), math.inf) if "." in name else (-math.inf, math.inf)


def _room_to_limit(limit: float, nominal: float) -> float:
    """How far a value may go from nominal to a limit, so that no rounding brings it beyond."""
    rounding = 4.0 * math.ulp(max(abs(limit), abs(nominal))) if math.isfinite(limit) else 0.0
    return max(0.0, abs(limit - nominal) - rounding)


def starts_of(model: Model, floors: Sequence[Floor], *, worn: bool, exact: bool = False) -> list[Unknown]:
    """Where the motor and the play were at each window's first sample, beyond what it says.

    Of a motor that a voltage is put in, its speed as well: such recordings begin anywhere in a motion, and no loop
    brings it back.  Of a speed loop with an integral action, what it asked for: a few samples of the current tell it,
    and what they are off by is in the position until the integral has made up for it.

    worn: the play may be far wider than the file says.  exact: the recordings are a simulation's, whose sensors are
    known but for their noise.
    """
    if not model.simulates_commands:
        return []
    transmission = model.actuator.transmission
    tau = transmission.gear_ratio
    half_play = 0.5 * transmission.backlash_rad / tau
    controller = model.actuator.controller
    has_integral = controller.kind == "cascade" and np.any(np.asarray(controller.integral_gain_Nm_rad) != 0.0)
    widest = half_play * (_WIDEST_PLAY if worn else 1.0)
    found = []
    for i, (window, floor) in enumerate(zip(model.windows, floors)):
        samples = math.sqrt(window.samples_per_block)
        if model.actuator.takes_voltage:
            found.append(Unknown(f"faster {i}", 0.0, _speed_at_start(window, floor), kind="faster", place=i))
            if not any(name in window.measured for name in POSITIONS):
                continue
        if has_integral and "current_A" in floor.noise:
            pull = controller.torque_constant_Nm_A * floor.noise["current_A"] * samples
            found.append(Unknown(f"pull {i}", 0.0, pull, kind="pull", place=i))
        motor = floor.noise.get("motor_position_rad", half_play) * samples
        user = floor.noise.get("user_position_rad", tau * widest) * samples / tau
        turned = math.hypot(motor, 0.0 if exact else _TURNED_RAD)
        play = math.hypot(motor, user, 0.0 if exact else half_play)
        found += [Unknown(f"turned {i}", 0.0, turned, kind="turned", place=i)] if turned > _LEAST_START_RAD else []
        found += [Unknown(f"play {i}", 0.0, play, kind="play", place=i)] if play > _LEAST_START_RAD else []
    return found


def _speed_at_start(window: Window, floor: Floor) -> float:
    """1 σ of the motor's speed at a window's start, rad/s, beyond the measured one or the measured position's slope."""
    if SPEED in floor.noise:
        return floor.noise[SPEED] * math.sqrt(window.samples_per_block)
    position = next(window.measured[name] for name in POSITIONS if name in window.measured)
    return float(np.max(np.abs(np.diff(position)))) / window.block_s


def loads_of(model: Model) -> list[Unknown]:
    """The load of each recording that has none, where it acts through the effect `LOAD` of the model."""
    if LOAD not in model.effects:
        return []
    motor, transmission = model.actuator.motor, model.actuator.transmission
    sigma = _UNRECORDED_LOAD * motor.torque_limit_Nm / transmission.gear_ratio
    most, usual = 1.0 / _UNRECORDED_LOAD, model.effects[LOAD]["torque_Nm"]
    return [
        Unknown(f"load {i}", usual, sigma, -most, most, "load", i)
        for i, measurement in enumerate(model.measurements)
        if "load_torque_Nm" not in measurement
    ]


def lags_of(model: Model) -> list[Unknown]:
    """By how long the current of each recording comes after its positions: a logger may well take it a sample apart.

    Without it, what the current leads or trails by is taken for friction and inertia that are off.
    """
    return [
        Unknown(f"lag {i}", 0.0, measurement.sample_period_s, kind="lag", place=i)
        for i, measurement in enumerate(model.measurements)
        if "current_A" in measurement and any(position in measurement for position in POSITIONS)
    ]


# --- the least-squares problem of every fit: unknowns with their priors, a model that simulates them, weights ---------

_EXACT = 1e-4  # of a tolerance, within which a parameter counts as its file's value
_LARGEST_RATIO = 0.5  # of a step, as a logarithm
DIVERGED = 1e6  # floors, that a run which diverges counts as at most

TOGETHER = 2 * LANES  # candidates: a block of lanes on each of two cores

SIGNALS = ("current_A", "motor_torque_Nm", "motor_position_rad", "user_position_rad")  # that are fitted


def fitted_signals(asked: Mapping[str, float], measured: Container[str]) -> dict[str, float]:
    """Of the signals that are asked for, with weights, those of a recording that are fitted.

    Where both positions are asked for and none was measured, its speed stands for them.
    """
    found = {name: weight for name, weight in asked.items() if name in measured}
    stands_in = all(name in asked and name not in measured for name in POSITIONS) and SPEED in measured
    return {**found, SPEED: asked.get(SPEED, 1.0)} if stands_in else found


class Rig(NamedTuple):
    """What `Model.signals` is asked for in one window, for one x or a population."""

    actuator: Actuator
    k: Array
    turned_rad: Any  # numbers, or (n,)
    play_rad: Any
    faster_rad_s: Any
    pull_Nm: Any
    effects: Effects


class Problem:
    """x (n, unknowns), each in σ of its prior → residuals (n, values + unknowns).

    They are model − measurement of every compared signal of every window over its floor, and x over its prior.
    signals: those to fit, with weights; all of `SIGNALS` without it.  k: of faults that do not move, (8,); without it,
    the actuator's own.
    """

    def __init__(
        self,
        model: Model,
        floors: Sequence[Floor],
        unknowns: Sequence[Unknown],
        signals: Mapping[str, float] | None = None,
        k: ArrayLike | None = None,
    ) -> None:
        self.model = model
        self.unknowns = list(unknowns)
        self.count = len(self.unknowns)
        self.low, self.high = np.array([u.low for u in unknowns]), np.array([u.high for u in unknowns])
        self.base = np.array([u.is_base for u in unknowns], dtype=bool)
        self.prior = np.ones(self.count)  # 1 over its σ, which is less than 1 for what is believed to be close
        self._step = np.array([u.step for u in unknowns])
        self.fixed_k = np.asarray(model.actuator.k if k is None else k, dtype=float)
        self._nominal, self._sigma = (np.array([getattr(u, one) for u in unknowns]) for one in ("nominal", "sigma"))
        self._scale = np.array([u.is_scale for u in unknowns], dtype=bool)
        self._faults = [(i, u.place) for i, u in enumerate(unknowns) if u.kind == "fault"]
        self._lags = {u.place: i for i, u in enumerate(unknowns) if u.kind == "lag"}  # by recording
        self._eccentricity = [i for i, place in self._faults if place in ECCENTRICITY]  # both parts, or none
        bent_most = sorted(range(self.count), key=lambda i: (unknowns[i].kind == "turned", unknowns[i].is_base))
        self._acting = [
            np.array(
                [i for i in bent_most if places.get(unknowns[i].kind, unknowns[i].place) == unknowns[i].place], int
            )
            for places in map(self._places, range(len(model.windows)))
        ]
        self.asked = signals or dict.fromkeys(SIGNALS, 1.0)
        self.reweighted(floors)
        if not self.values:
            raise InputError(f"none of the recordings has a signal of {', '.join(self.asked)}")

    def reweighted(self, floors: Sequence[Floor], added: Sequence[Mapping[str, Array]] = ()) -> None:
        """Sets other floors, and what the model is known to lack, by window and signal, (blocks,), which is added."""
        self.floors, self.added = list(floors), list(added)
        self.weights = [
            {name: weight / one.fit_sigma(name) for name, weight in fitted_signals(self.asked, window.measured).items()}
            for window, one in zip(self.model.windows, self.floors)
        ]
        self.values = sum(len(values) for weights in self.weights for values in weights.values())

    def believe(self, spread: ArrayLike) -> None:
        """Takes base parameters to be within `spread` of their tolerances: of all, or of each (base parameters,)."""
        self.prior[self.base] = 1.0 / np.maximum(spread, _EXACT)

    @property
    def steps(self) -> Array:
        """Of the differences that derivatives are taken by, σ, (unknowns,)."""
        return self._step

    def residuals(self, x: Array) -> Array:
        """(n, unknowns) → (n, values + unknowns)."""
        errors = windows(lambda window: self._errors(x, window), range(len(self.weights)))
        return np.concatenate([*errors, x * self.prior], axis=1)

    def jacobians(self, x: Array, *, in_whole_blocks: bool = False) -> tuple[Array, Array]:
        """Residuals (n, m) and their derivatives (n, m, unknowns) by central differences, of scales in their logarithm.

        Where a gain, a torque constant and a resistance act by their ratio alone, only steps by ratios leave the
        signals as they are along it; equal steps up and down show information that is not there.

        A window is simulated in one population, for the unknowns that act in it: not for where the others start.
        in_whole_blocks: no block of lanes is begun for a part of it; the unknowns that bend the signals least then
        have a difference to one side, which a step on the way may have.
        """
        return self.jacobians_beside(x, np.zeros((0, self.count)), in_whole_blocks=in_whole_blocks)[:2]

    def jacobians_beside(self, x: Array, others: Array, *, in_whole_blocks: bool) -> tuple[Array, Array, Array]:
        """The same, and the residuals of other candidates (l, unknowns) that are simulated with them, (l, m)."""
        n = len(x)
        slopes = np.zeros((n, self.count, self.values + self.count))
        ends = np.cumsum([0, *(sum(map(len, weights.values())) for weights in self.weights)])

        def of_window(window: int) -> tuple[Array, Array]:
            rows = slice(ends[window], ends[window + 1])
            return self._differences(x, others, window, in_whole_blocks, slopes[:, :, rows])

        residuals, beside = zip(*windows(of_window, range(len(self.weights))))
        at = np.arange(self.count)
        slopes[:, at, self.values + at] = self.prior
        found = np.concatenate([*residuals, x * self.prior], axis=1)
        return found, np.swapaxes(slopes, 1, 2), np.concatenate([*beside, others * self.prior], axis=1)

    def _differences(
        self, x: Array, others: Array, window: int, in_whole_blocks: bool, slopes: Array
    ) -> tuple[Array, Array]:
        """A window's part of the residuals of x (n, values) and of others (l, values); slopes, too, is written."""
        n, acting = len(x), self._acting[window]
        low, high = (np.clip(self.moved(x, by), self.low, self.high) for by in (-self._step, self._step))
        far = np.where(high - x >= x - low, high, low)
        both = _room(n, len(acting), len(others)) if in_whole_blocks else len(acting)
        sides, side = acting[:both], acting[both:]
        lanes = 1 + 2 * len(sides) + len(side)
        points = np.repeat(x[:, None, :], lanes, axis=1)
        for at, moved, to in ((1, sides, low), (1 + both, sides, high), (1 + 2 * both, side, far)):
            points[:, at + np.arange(len(moved)), moved] = to[:, moved]
        shown = self._errors(np.concatenate([points.reshape(-1, self.count), others]), window)
        errors = shown[: n * lanes].reshape(n, lanes, -1)
        here, below, above, there = np.split(errors, [1, 1 + both, 1 + 2 * both], axis=1)
        slopes[:, sides] = (above - below) / self.distance(x, low, high)[:, sides, None]
        slopes[:, side] = (there - here) / self.distance(x, x, far)[:, side, None]
        return errors[:, 0], shown[n * lanes :]

    def moved(self, x: Array, by: Array) -> Array:
        """x (…, unknowns) that is moved by so many σ (…, unknowns), of scales by a ratio that begins as such a step."""
        values = self._nominal + self._sigma * x
        scales = self._scale & (values > 0.0)
        ratio = np.exp(np.clip(by * self._sigma / np.where(scales, values, 1.0), -_LARGEST_RATIO, _LARGEST_RATIO))
        return np.where(scales, (values * ratio - self._nominal) / self._sigma, x + by)

    def distance(self, x: Array, start: Array, end: Array) -> Array:
        """From start to end, in σ, as a derivative at x has it: of scales the logarithm of their ratio."""
        values, of_start, of_end = (self._nominal + self._sigma * one for one in (x, start, end))
        logarithmic = self._scale & (values > 0.0) & (of_start > 0.0) & (of_end > 0.0)
        ratio = np.divide(of_end, of_start, out=np.ones_like(values), where=logarithmic)
        return np.where(logarithmic, np.log(ratio) * values / self._sigma, end - start)

    def has_room_for(self, others: int) -> bool:
        """Whether so many candidates stand together with the derivatives of one, all to both sides."""
        return 1 + 2 * self.count + others <= TOGETHER

    def points_in_whole_blocks(self, n: int) -> int:
        """How many of a window `jacobians` of n candidates simulates in whole blocks, at most."""
        return n * (1 + self.count + _room(n, self.count, 0))

    def _errors(self, x: Array, window: int) -> Array:
        """A window's part of the residuals of x (n, unknowns): (n, values); of a run that diverges a very great one."""
        shown, measured = self.simulate(x, window), self.model.windows[window].measured
        added = self.added[window] if self.added else {}
        weights = self.weights[window]
        found = np.empty((len(x), sum(map(len, weights.values()))))
        first = 0
        for name, weight in weights.items():
            part = found[:, first : first + len(weight)]
            np.subtract(shown[name], measured[name], out=part)
            if name in added:
                part += added[name]
            part *= weight
            first += len(weight)
        np.clip(found, -DIVERGED, DIVERGED, out=found)
        if np.isnan(found).any():
            found[np.isnan(found)] = DIVERGED
        return found

    def _places(self, window: int) -> dict[str, int]:
        """Of the kinds that are not all windows' alike: where a window's own stands."""
        recording = self.model.windows[window].recording
        return {**dict.fromkeys(STARTS, window), "load": recording, "lag": recording}

    def parts(self) -> list[tuple[int, str, slice]]:
        """Where the residuals of each window's signals stand: window, signal, rows."""
        found, first = [], 0
        for i, weights in enumerate(self.weights):
            for name, values in weights.items():
                found.append((i, name, slice(first, first + len(values))))
                first += len(values)
        return found

    def over_sigma(self, window: int, name: str, values: Array) -> Array:
        """Values (…, blocks) of a window's signal as residuals are: over σ."""
        return values * self.weights[window][name]

    def clip(self, x: Array) -> Array:
        """x inside its bounds, the eccentricity inside its disc."""
        x = np.clip(x, self.low, self.high)
        if len(self._eccentricity) == 2:
            at = self._eccentricity
            parts = self._nominal[at] + self._sigma[at] * x[..., at]
            parts /= np.maximum(1.0, np.linalg.norm(parts, axis=-1, keepdims=True))
            x[..., at] = (parts - self._nominal[at]) / self._sigma[at]
        return x

    def simulate(self, x: Array, window: int, *, even: bool = False) -> Signals:
        """Signals of a window, by its place, for x (n, unknowns): (n, blocks) each; even: as of `Model.signals`."""
        return self.logged(self.model.signals(window, *self.rig(x, window), even=even), x, window)

    def logged(self, shown: Signals, x: Array, window: int) -> Signals:
        """A window's signals (n, blocks) as its logger has them, at x (n, unknowns): the current comes after them."""
        at = self.model.windows[window]
        if at.recording not in self._lags:
            return shown
        column = self._lags[at.recording]
        late_s = self._nominal[column] + self._sigma[column] * x[:, [column]]
        return {**shown, "current_A": later(shown["current_A"], late_s, at.block_s)}

    def vector(self, x: Array) -> Array:
        """The faults at x (…, unknowns), the eccentricity as a vector: (…, 8)."""
        vector = np.tile(to_vector(self.fixed_k), (*x.shape[:-1], 1))
        for column, place in self._faults:
            vector[..., place] = self._nominal[column] + self._sigma[column] * x[..., column]
        return vector

    def k(self, x: Array) -> Array:
        """The faults at x (…, unknowns): (…, 8)."""
        return to_k(self.vector(x)) if self._faults else np.tile(self.fixed_k, (*x.shape[:-1], 1))

    def at(self, k: ArrayLike) -> Array:
        """x (…, unknowns) of faults (…, 8), all else as it is known: the inverse of `k`."""
        vector = to_vector(k)
        x = np.zeros((*vector.shape[:-1], self.count))
        for column, place in self._faults:
            x[..., column] = (vector[..., place] - self._nominal[column]) / self._sigma[column]
        return x

    def parameters(self, x: Array) -> dict[str, Any]:
        """The actuator's values at x (…, unknowns), by path: numbers, or (n,)."""
        values = (self._nominal + self._sigma * x).T
        parameters = {u.name: one for u, one in zip(self.unknowns, values) if u.kind == "parameter"}
        return parameters if x.ndim > 1 else {path: float(one) for path, one in parameters.items()}

    def rig(self, x: Array, window: int) -> Rig:
        """What a window is simulated with at x (unknowns,), or for a population (n, unknowns)."""
        values = (self._nominal + self._sigma * x).T
        places = self._places(window)
        own: dict[str, Any] = {u.kind: one for u, one in zip(self.unknowns, values) if places.get(u.kind) == u.place}
        effects: Effects = self.model.effects
        if "load" in own:
            effects = {**effects, LOAD: {"torque_Nm": own["load"]}}
        actuator = self.model.actuator.varied(self.parameters(x))
        turned, play, faster, pull = (own.get(kind, 0.0) for kind in STARTS)
        return Rig(actuator, self.k(x), turned, play, faster, pull, effects)


def _room(n: int, count: int, others: int) -> int:
    """Of `count` unknowns, those that can be moved to both sides in the blocks that one side fills, of `TOGETHER` each.

    others: candidates that stand in the same blocks.
    """
    blocks = -(-(n * (1 + count) + others) // TOGETHER)
    return min(count, (blocks * TOGETHER - others) // n - (1 + count))

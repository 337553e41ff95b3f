"""What a campaign can do: kinds of tasks, each with its settings, its columns, one run, and what rows say together.

To add one, add a `Kind` here and to `KINDS`: plans, tables and reports find it.
"""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
import pyarrow as pa

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.campaign.benchmark import BENCHMARK
from ema_model.campaign.task import FLAG, NUMBER, NUMBERS, TEXT, TEXTS, Kind, TaskInputs
from ema_model.comparison import compare
from ema_model.comparison.compare import weights_of
from ema_model.comparison.thresholds import BAND
from ema_model.discovery import discover
from ema_model.errors import InputError, quoted
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import fit, gather
from ema_model.faults import NAMES
from ema_model.fleet.compare import compare_units
from ema_model.fleet.result import Difference, UnitsCompared
from ema_model.identification.run import ALGORITHMS, ROBUST, identify
from ema_model.identification.search import Objective
from ema_model.quantities import explanation_title
from ema_model.recordings import Measurement, prepared
from ema_model.simulated_fleets import RUNS, UNSEEN, Fleet, draw, recorded
from ema_model.simulated_lives import LAWS, Life, drawn, healthy_life, worn_life
from ema_model.simulation.plant import FITNESSES
from ema_model.tracking.track import TRACKED, Tracker

# --- k1 … k8 of recordings, with their intervals ----------------------------------------------------------------------


@dataclass(frozen=True)
class IdentifySettings:
    """As `emaviz identify` has them."""

    algorithm: str = ROBUST
    population: int = 50
    iterations: int = 150
    fitness: str = "filtered"
    circuit: str = "reduced"
    polish: bool = False
    parameters_known: bool = False

    def __post_init__(self) -> None:
        for what, value, known in (
            ("algorithm", self.algorithm, ALGORITHMS),
            ("fitness", self.fitness, FITNESSES),
            ("circuit", self.circuit, ("reduced", "thesis")),
        ):
            if value not in known:
                raise InputError(f"no {what} {quoted(value)!r}; there are {', '.join(known)}")
        if not (2 <= self.population <= 100_000 and 1 <= self.iterations <= 1_000_000):
            raise InputError("population is from 2 to 100000, iterations from 1 to 1000000")


def _identify(inputs: TaskInputs, settings: IdentifySettings, seed: int) -> dict[str, Any]:
    objective, held = (
        Objective(one, inputs.actuator, circuit=settings.circuit, fitness=settings.fitness) if one else None
        for one in (inputs.fitted, inputs.held)
    )
    assert objective is not None
    answer = identify(
        objective,
        settings.algorithm,
        population=settings.population,
        iterations=settings.iterations,
        seed=seed,
        truth=inputs.truth,
        parameters_known=settings.parameters_known,
        polish=settings.polish,
    )
    sure = answer.uncertainty
    low, high = sure.interval90.T
    return {
        "algorithm": settings.algorithm,
        "population": settings.population,
        "iterations": settings.iterations,
        **{name: float(value) for name, value in zip(faults.NAMES, answer.k)},
        **{f"{name}_low": float(value) for name, value in zip(faults.NAMES, low)},
        **{f"{name}_high": float(value) for name, value in zip(faults.NAMES, high)},
        "error_percent": answer.error_percent,
        "error_wrapped_percent": None
        if inputs.truth is None
        else faults.error_percent(answer.k, inputs.truth, wrap=True),
        "rmse_A": answer.rmse,
        "holdout_rmse_A": None if held is None else float(held(answer.k)[0]),
        "healthy": bool(sure.healthy),
        "alarms": list(sure.alarms),
        "adequate": bool(sure.adequate),
        "ambiguous": ["+".join(group) for group in sure.ambiguous],
        "evaluations": int(answer.evaluations),
        "rmse_history_A": answer.rmse_history.tolist(),
        "error_history_percent": None
        if inputs.truth is None
        else [faults.error_percent(k, inputs.truth) for k in answer.k_history],
        "answer_s": answer.elapsed_s,
    }


def _identify_seconds(settings: IdentifySettings) -> float:
    if settings.algorithm == ROBUST:
        return 1.2 + 0.012 * settings.population
    return 1.0 + 2e-4 * settings.population * settings.iterations


def covered(row: dict[str, Any]) -> list[bool]:
    """By k, whether its interval holds the truth; k7 is an angle."""
    inside = []
    for name, true in zip(faults.NAMES, row["k_true"]):
        low, high = row[f"{name}_low"], row[f"{name}_high"]
        off = true - 0.5 * (low + high)
        if name == "k7":
            off -= round(off)
        inside.append(abs(off) <= 0.5 * (high - low) + 1e-12)
    return inside


def _identifications(rows: list[dict[str, Any]]) -> dict[str, Any]:
    known = [row for row in rows if row["k_true"] is not None]
    told: dict[str, Any] = {}
    if known:
        errors = [row["error_wrapped_percent"] for row in known]
        inside = np.array([covered(row) for row in known], dtype=float)
        inside[[row["k6_low"] <= 0.0 for row in known], 6] = np.nan  # an eccentricity that may be none has no phase
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            share = 100.0 * np.nanmean(inside, axis=0)
        told = {
            "Err % median": f"{np.median(errors):.2f}",
            "95 %": f"{np.percentile(errors, 95):.2f}",
            "worst": f"{max(errors):.2f}",
            "90 % intervals that hold k1 … k8, %": " ".join("–" if np.isnan(s) else f"{s:.0f}" for s in share),
        }
    return told | {
        "healthy": sum(row["healthy"] for row in rows),
        "with alarms": sum(bool(row["alarms"]) for row in rows),
        "does not fit": sum(not row["adequate"] for row in rows),
    }


IDENTIFY = Kind(
    title="Identification",
    settings=IdentifySettings,
    columns=pa.schema(
        [
            ("algorithm", TEXT),
            ("population", pa.int64()),
            ("iterations", pa.int64()),
            *((name, NUMBER) for name in faults.NAMES),
            *((f"{name}_low", NUMBER) for name in faults.NAMES),
            *((f"{name}_high", NUMBER) for name in faults.NAMES),
            ("error_percent", NUMBER),  # as the thesis has it
            ("error_wrapped_percent", NUMBER),  # k7 as the angle that it is
            ("rmse_A", NUMBER),
            ("holdout_rmse_A", NUMBER),
            ("healthy", FLAG),
            ("alarms", TEXTS),
            ("adequate", FLAG),
            ("ambiguous", TEXTS),
            ("evaluations", pa.int64()),
            ("rmse_history_A", NUMBERS),
            ("error_history_percent", NUMBERS),  # as the thesis has it, of the best so far
        ]
    ),
    run=_identify,
    seconds=_identify_seconds,
    told=_identifications,
)


# --- where the model fails beside recordings, and what explains it ----------------------------------------------------


@dataclass(frozen=True)
class CompareSettings:
    """As `emaviz compare` has them."""

    calibrate: bool = True


def _compare(inputs: TaskInputs, settings: CompareSettings, seed: int) -> dict[str, Any]:
    found = compare(inputs.fitted, inputs.actuator, calibrate=settings.calibrate, holdout=inputs.held).to_dict()
    first = next((one for one in found["explained_by"] if one["significant"]), {})
    error, calibration = found["signals"][found["primary"]], found["calibration"]
    return {
        "adequate": found["adequate"],
        "sentence": found["sentences"][0],
        "signal": found["primary"],
        "over_floor": found["over_floor"],
        "floor_band": found["floor_band"],
        "rmse": error["rmse"],
        "noise_floor": error["noise_floor"],
        "variable": first.get("variable"),
        "modulator": first.get("modulator"),
        "r2": first.get("r2"),
        "orders": [float(one["order"]) for one in found["orders"]],
        "converged": None if calibration is None else calibration["converged"],
    }


def _comparisons(rows: list[dict[str, Any]]) -> dict[str, Any]:
    first = Counter(explanation_title(row["variable"], row["modulator"]) for row in rows)
    orders = Counter(f"{row['orders'][0]:g}" for row in rows if row["orders"])
    return {
        "adequate": sum(row["adequate"] for row in rows),
        "explained first by": ", ".join(f"{name} {count}" for name, count in first.most_common(4)),
        "strongest order": ", ".join(f"{order}: {count}" for order, count in orders.most_common(3)) or "–",
        "error over floor, median": f"{np.median([row['over_floor'] for row in rows]):.2f}",
        "in its 90 % band": sum(low <= row["over_floor"] <= high for row in rows for low, high in [row["floor_band"]]),
    }


COMPARE = Kind(
    title="Comparison",
    settings=CompareSettings,
    columns=pa.schema(
        [
            ("adequate", FLAG),
            ("sentence", TEXT),
            ("signal", TEXT),  # whose residual is explained
            ("over_floor", NUMBER),  # pooled over signals
            ("floor_band", NUMBERS),
            ("rmse", NUMBER),
            ("noise_floor", NUMBER),
            ("variable", TEXT),  # of the first significant explanation; null where there is none
            ("modulator", TEXT),
            ("r2", NUMBER),
            ("orders", NUMBERS),  # per turn, the strongest first
            ("converged", FLAG),
        ]
    ),
    run=_compare,
    seconds=lambda settings: 4.0,
    told=_comparisons,
)


# --- how much hidden effects change recordings beyond what the tolerances can: whether anyone could see them ----------


def showable(
    recordings: Sequence[Measurement],
    actuator: Actuator,
    effects: Mapping[str, Mapping[str, float]],
    signals: Sequence[str] | None = None,
) -> float:
    """Expected fall of χ² at the effects' true settings."""
    data = gather([prepared(one, actuator) for one in recordings], actuator, weights_of(signals, actuator), None)
    data = data.beside(fit(data, actuator))
    base = fit(data, actuator)
    x = base.calibration.x
    with_them = data.plant(replace(actuator, effects={name: dict(given) for name, given in effects.items()}))
    problem = problem_of(with_them, data.floors, signals=data.signals)
    change = problem.residuals(x[None, :])[0, : problem.values] - base.residual
    columns = base.calibration.weighted_jacobian
    own = change - columns @ np.linalg.solve(columns.T @ columns + np.eye(len(x)), columns.T @ change)
    return float(change @ own)


# --- which effects are missing: the verdict, what was added, the error ladder -----------------------------------------

_LARGEST_GROUP = 3  # of effects that cannot be told apart, with which a name is still an answer
_SIGNALS = {"all": None, "current": ["current_A"]}


@dataclass(frozen=True)
class DiscoverSettings:
    """As `emaviz discover` has them."""

    signals: str = "all"
    most_effects: int = 100
    showable_from: float = 0.0  # of χ²: hidden effects that change the recordings by less are not looked for

    def __post_init__(self) -> None:
        if self.signals not in _SIGNALS:
            raise InputError(f"no signals {quoted(self.signals)!r}; there are {', '.join(_SIGNALS)}")
        if not 0 <= self.most_effects <= 100:
            raise InputError(f"most_effects is a whole number from 0 to 100, not {self.most_effects}")


def _discover(inputs: TaskInputs, settings: DiscoverSettings, seed: int) -> dict[str, Any]:
    signals = _SIGNALS[settings.signals]
    asked: dict[str, Any] = {"signals": settings.signals, "showable": None}
    if settings.showable_from > 0.0 and inputs.effects:
        asked["showable"] = showable(inputs.fitted, inputs.actuator, inputs.effects, signals)
        if asked["showable"] < settings.showable_from:
            return asked
    found = discover(
        inputs.fitted,
        inputs.actuator,
        holdout=inputs.held,
        signals=signals,
        most_effects=settings.most_effects,
    ).to_dict()
    ladder, faults, experiment = found["ladder"], found["faults"], found["next_experiment"]
    unknown, calibrated = found["unknown"], found["calibration"]["parameters"]
    return asked | {
        "verdict": found["verdict"],
        "effects": [one["name"] for one in found["effects"]],
        "same_as": ["+".join(one["same_as"]) for one in found["effects"]],
        "parameters": json.dumps(
            {one["name"]: {name: p["value"] for name, p in one["parameters"].items()} for one in found["effects"]}
        ),
        "outside": found["parameters_outside_tolerance"],
        "at_bound": [name for name, one in calibrated.items() if one["at_bound"]],
        "calibrated": json.dumps(
            {name: [one["value"], *(one["interval90"] or (None, None))] for name, one in calibrated.items()}
        ),
        "controller_mismatch": found["controller_mismatch"],
        "transmission": None if found["transmission_seen"] is None else found["transmission_seen"]["cause"],
        "unknown": None if unknown is None else f"{unknown['variable']} × {unknown['modulator']}",
        "rungs": [rung["label"] for rung in ladder],
        "ladder": [rung["rmse"] for rung in ladder],
        "floor_band": found["floor_band"],
        "holdout_ladder": [rung["holdout_rmse"] for rung in ladder],
        "faults": list(faults),
        "fault_values": [one["value"] for one in faults.values()],
        "warnings": found["warnings"],
        "next_experiment": None if experiment is None else json.dumps(experiment, sort_keys=True),
    }


def tally(row: dict[str, Any]) -> Counter[str]:
    """What one discovery of hidden effects got right; what cannot be told from an effect counts as it, in groups."""
    hidden = set(row["hidden"])
    named = [{name, *filter(None, same.split("+"))} for name, same in zip(row["effects"], row["same_as"])]
    right = bool(named) and bool(named[0] & hidden) and len(named[0]) <= _LARGEST_GROUP
    covered = [group & hidden for group in named]
    exact = all(covered) and set().union(*covered) >= hidden and len(named) == len(hidden)
    ends = [ladder[-1] for ladder in (row["ladder"], row["holdout_ladder"]) if ladder and ladder[-1] is not None]
    counts = {
        "first": right,
        "exact": exact,
        "wrong": bool(named) and not right and len(named[0]) == 1,
        "abstained": not named,
        "floor": exact and max(ends, default=0.0) <= BAND,
    }
    return Counter({name: int(one) for name, one in counts.items()})


def _discoveries(rows: list[dict[str, Any]]) -> dict[str, Any]:
    shown = [row for row in rows if row["verdict"] is not None]
    told: dict[str, Any] = {"showable": len(shown)}
    if any(row["hidden"] for row in rows):
        counts = sum((tally(row) for row in shown if row["hidden"]), Counter())
        told |= {
            "right one first": counts["first"],
            "exactly": counts["exact"],
            "wrong, sure": counts["wrong"],
            "abstained": counts["abstained"],
            "exactly, and at the floor": counts["floor"],
        }
    verdicts = Counter(row["verdict"] for row in shown)
    return told | {"verdicts": ", ".join(f"{verdict} {count}" for verdict, count in verdicts.most_common())}


DISCOVER = Kind(
    title="Discovery",
    settings=DiscoverSettings,
    columns=pa.schema(
        [
            ("signals", TEXT),
            ("showable", NUMBER),  # expected fall of χ²; null where it was not asked for
            ("verdict", TEXT),  # null where the effects cannot be seen
            ("effects", TEXTS),
            ("same_as", TEXTS),  # of each effect, the names that cannot be told from it, joined by +
            ("parameters", TEXT),  # of the effects, as JSON: their values by name
            ("outside", TEXTS),
            ("at_bound", TEXTS),  # calibrated parameters
            ("calibrated", TEXT),  # parameters of the last model as JSON: value and 90 % interval by name
            ("controller_mismatch", FLAG),
            ("transmission", TEXT),  # what the user's position leaves the motor's by; null where it does not
            ("unknown", TEXT),  # what the rest goes with: variable × modulator
            ("rungs", TEXTS),
            ("ladder", NUMBERS),  # in units of the floor
            ("floor_band", NUMBERS),  # between which nine of ten true models end
            ("holdout_ladder", NUMBERS),
            ("faults", TEXTS),
            ("fault_values", NUMBERS),
            ("warnings", TEXTS),
            ("next_experiment", TEXT),
        ]
    ),
    run=_discover,
    seconds=lambda settings: 12.0,
    told=_discoveries,
)


# --- fleets that are made: whether what differs between units is found, all of it and nothing else --------------------
# A difference counts as found where the unit is right and the parameters that are named for it are among those that its
# recordings tell only together; of two units, either may be said to differ. The set is exact where each is found and
# nothing else is said.


@dataclass(frozen=True)
class FleetSettings:
    """Which fleets; what is 0 or −1 is drawn."""

    units: int = 0
    differing: int = -1  # parameters; drawn from 1 to 3
    size: float = 5.0  # of the differences, σ of what a unit's recordings tell
    spread: float = 0.0  # of a tolerance, by which all units scatter
    without_step: bool = False  # the recording that tells most parameters apart
    holdout: bool = True

    def __post_init__(self) -> None:
        if not (self.units == 0 or 2 <= self.units <= 20) or not -1 <= self.differing <= 3:
            raise InputError("units are from 2 to 20, or 0 to be drawn; differing from 0 to 3, or -1 to be drawn")


def fleet_of(settings: FleetSettings, actuator: Actuator, seed: int) -> Fleet:
    """The fleet of a task."""
    return draw(
        actuator,
        seed,
        units=settings.units or None,
        differing=None if settings.differing < 0 else settings.differing,
        size=settings.size,
        spread=settings.spread,
        runs=tuple(name for name in RUNS if not (settings.without_step and name == "step")),
    )


def _compare_fleet(inputs: TaskInputs, settings: FleetSettings, seed: int) -> dict[str, Any]:
    fleet = fleet_of(settings, inputs.actuator, seed)
    unseen = tuple(UNSEEN) if settings.holdout else ()
    fitted: dict[str, list[Measurement]] = {}
    held: dict[str, list[Measurement]] = {}
    for number, name in enumerate(fleet.names):
        every = recorded(fleet.unit(number), seed, number, (*fleet.runs, *unseen))
        fitted[name] = [every[run] for run in fleet.runs]
        held[name] = [every[run] for run in unseen]
    begun = perf_counter()
    found = compare_units(fitted, inputs.actuator, holdout=held, seed=seed)
    return scored(fleet, found) | {"answer_s": perf_counter() - begun}


def scored(fleet: Fleet, found: UnitsCompared) -> dict[str, Any]:
    """What was found beside the truth."""
    left = list(found.differences)
    met: list[tuple[Difference, float]] = []  # with the true change, in the parameter's unit
    missed = []
    for one in fleet.differences:
        for unit in one.units:
            change = one.change * fleet.actuator.tolerances[one.parameter].sigma
            match = next((d for d in left if _is_met(d, fleet, unit, one.parameter, one.together)), None)
            if match is None:
                missed.append(f"{fleet.names[unit]} {one.parameter}")
            else:
                left.remove(match)
                met.append((match, change if match.unit == fleet.names[unit] else -change))
    own = [(one, change) for one, change in met if one.parameter in _parameters(fleet)]
    return {
        "units": float(len(fleet.names)),
        "true": float(len(met) + len(missed)),
        "found": float(len(met)),
        "exact": not missed and not left,
        "claimed": bool(found.differences),
        "scatter": [*found.scattering],
        "missed": missed,
        "false": [f"{one.unit} {'+'.join(one.together)}" for one in left],
        "contradicted": [f"{one.unit} {one.parameter}" for one in found.dropped],
        "covered": float(sum(one.change90[0] <= change <= one.change90[1] for one, change in own)),
        "counted": float(len(own)),
        "right_sign": float(sum(one.change * change > 0.0 for one, change in own)),
    }


def _parameters(fleet: Fleet) -> set[str]:
    return {one.parameter for one in fleet.differences}


def _is_met(found: Difference, fleet: Fleet, unit: int, parameter: str, together: tuple[str, ...]) -> bool:
    right = found.unit == fleet.names[unit] or len(fleet.names) == 2
    return right and parameter in found.together and set(found.together) <= {parameter, *together}


def _fleets(rows: list[dict[str, Any]]) -> dict[str, Any]:
    counted = sum(row["counted"] for row in rows)
    true = sum(row["true"] for row in rows)
    told: dict[str, Any] = {
        "exact set": f"{sum(row['exact'] for row in rows)} of {len(rows)}",
        "fleets with a false claim": sum(bool(row["false"]) for row in rows),
        "fleets said to scatter": sum(bool(row["scatter"]) for row in rows),
    }
    if not true:
        return told
    return told | {
        "differences found": f"{sum(row['found'] for row in rows):g} of {true:g}",
        "90 % interval holds it, %": f"{100.0 * sum(row['covered'] for row in rows) / max(counted, 1.0):.1f}",
        "right sign": f"{sum(row['right_sign'] for row in rows):g} of {counted:g}",
        "dropped by held-out recordings": sum(len(row["contradicted"]) for row in rows),
        "units, median": f"{np.median([row['units'] for row in rows]):g}",
    }


FLEETS = Kind(
    title="Fleets",
    settings=FleetSettings,
    columns=pa.schema(
        [
            ("units", NUMBER),
            ("true", NUMBER),  # differences, a unit each
            ("found", NUMBER),
            ("exact", FLAG),
            ("claimed", FLAG),
            ("scatter", TEXTS),  # parameters in which all units are said to scatter
            ("missed", TEXTS),
            ("false", TEXTS),
            ("contradicted", TEXTS),
            ("covered", NUMBER),  # of those counted, by the interval
            ("counted", NUMBER),  # found under the parameter's own name
            ("right_sign", NUMBER),
        ]
    ),
    run=_compare_fleet,
    seconds=lambda settings: 1.0 + 1.6 * (settings.units or 11),
    told=_fleets,
    from_recordings=False,
)


# --- lives that are made: whether a trend is seen, and how the remaining life told compares with the true one ---------
# The measures are those of Saxena et al., "Metrics for offline evaluation of prognostic performance", IJPHM 1 (2010),
# over the time from the flight in which a remaining life is first told (λ = 0) to the last one (λ = 1): α-λ, whether
# the median is within α of the true remaining life at λ; relative accuracy 1 − |r − r*|/r*, and its mean over λ, the
# cumulative one.

ALPHA, LAMBDA = 0.2, 0.5
LAMBDAS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of the cumulative relative accuracy
_HEALTHY = "healthy"


@dataclass(frozen=True)
class LifeSettings:
    """Which lives."""

    law: str = "linear"
    variation: float = 0.5  # coefficient of variation of a flight's wear

    def __post_init__(self) -> None:
        if self.law not in (*LAWS, _HEALTHY):
            raise InputError(f"no wear law {quoted(self.law)!r}; there are {', '.join((*LAWS, _HEALTHY))}")
        if not 0.05 <= self.variation <= 3.0:
            raise InputError(f"variation is from 0.05 to 3, not {self.variation:g}")


@dataclass(frozen=True)
class Told:
    """A remaining life that was told after a flight, and the true one."""

    flight: int
    true: float
    p05: float
    p50: float
    p95: float

    @property
    def defined(self) -> bool:
        """Whether a remaining life was told at all."""
        return bool(np.isfinite(self.p50))

    @property
    def relative_accuracy(self) -> float:
        """1 − |r − r*|/r*, below 0 where it is off by more than all of it."""
        return 1.0 - abs(self.p50 - self.true) / self.true


def life_of(settings: LifeSettings, seed: int) -> Life:
    """The life of a task."""
    if settings.law == _HEALTHY:
        return healthy_life(seed, variation=settings.variation)
    return worn_life(settings.law, seed, settings.variation)


def places(first: int, last: int, lambdas: Sequence[float]) -> list[int]:
    """The flights (counted from 0) at λ between the first told and the one that crosses."""
    return [min(last - 1, first + round(share * (last - first))) for share in lambdas]


def _track_life(inputs: TaskInputs, settings: LifeSettings, seed: int) -> dict[str, Any]:
    life = life_of(settings, seed)
    last = life.flights - 1
    tracker = Tracker({life.fault: life.threshold} if life.fault else {}, seed)
    trends: set[str] = set()
    looks: list[int] = []
    told: list[Told] = []
    for i, flight in enumerate(drawn(life)):
        tracker.add(flight)
        trends |= {name for name in TRACKED if tracker.has_trend(name)}
        if not looks and life.fault and tracker.has_trend(life.fault) and (life.repaired or 0) <= i < last:
            looks = places(i, last, (0.0, *LAMBDAS))
        if i in looks:
            told += [_told_after(tracker, life, i)] * looks.count(i)
    jumps = [jump for one in tracker.look().faults.values() for jump in one.jumps]
    counted = [one.relative_accuracy for one in told[1:] if one.defined]
    middle = told[1 + LAMBDAS.index(LAMBDA)] if told else None
    return {
        "fault": life.fault or None,
        "flights": float(life.flights),
        "repaired": None if life.repaired is None else float(life.repaired),
        "trends": sorted(trends),
        "false_trends": sorted(trends - _wearing(life)),
        "jumps": float(len(jumps)),
        "at": [float(one.flight) for one in told],
        "true": [one.true for one in told],
        **{name: [getattr(one, name) for one in told] for name in ("p05", "p50", "p95")},
        "alpha_lambda": None if middle is None else float(middle.defined and middle.relative_accuracy >= 1.0 - ALPHA),
        "cra": float(np.mean(counted)) if counted else None,
    }


def _told_after(tracker: Tracker, life: Life, i: int) -> Told:
    left = tracker.look().faults[life.fault].remaining_flights
    told = (np.nan, np.nan, np.nan) if left is None else (left.p05, left.p50, left.p95)
    return Told(i, float(life.flights - 1 - i), *told)


def _wearing(life: Life) -> set[str]:
    moved = dict(zip(NAMES, np.ptp(life.k, axis=0) > 0.0))
    return {name for name in TRACKED if moved[name]}


def _lives(rows: list[dict[str, Any]]) -> dict[str, Any]:
    worn = [row for row in rows if row["fault"]]
    repairs = sum(row["repaired"] is not None for row in rows)
    told: dict[str, Any] = {
        "lives with a false trend": sum(bool(row["false_trends"]) for row in rows),
        "jumps found / repairs": f"{sum(row['jumps'] for row in rows):g} / {repairs}",
    }
    if not worn:
        return told
    seen = [row for row in worn if row["at"]]
    answers = [one for row in seen for one in zip(row["true"], row["p05"], row["p95"])]
    defined = [one for one in answers if np.isfinite(one[1])]
    held = sum(low <= true <= high for true, low, high in defined)
    accuracies = [row["cra"] for row in seen if row["cra"] is not None]
    return told | {
        "wear seen before the end": len(seen),
        "undefined answers": f"{len(answers) - len(defined)} of {len(answers)}",
        "90 % interval holds the life, %": f"{100.0 * held / max(len(defined), 1):.1f}",
        "α-λ": f"{np.mean([row['alpha_lambda'] for row in seen]):.2f}" if seen else "–",
        "cumulative relative accuracy": f"{np.mean(accuracies):.2f}" if accuracies else "–",
        "its median": f"{np.median(accuracies):.2f}" if accuracies else "–",
    }


TRACK = Kind(
    title="Lives",
    settings=LifeSettings,
    columns=pa.schema(
        [
            ("fault", TEXT),  # that crosses; null in a healthy life
            ("flights", NUMBER),
            ("repaired", NUMBER),
            ("trends", TEXTS),
            ("false_trends", TEXTS),  # of k that do not wear
            ("jumps", NUMBER),
            ("at", NUMBERS),  # flights, from 0, after which the remaining life was told: λ = 0, and LAMBDAS
            ("true", NUMBERS),  # remaining flights then
            ("p05", NUMBERS),  # NaN where it was undefined
            ("p50", NUMBERS),
            ("p95", NUMBERS),
            ("alpha_lambda", NUMBER),
            ("cra", NUMBER),
        ]
    ),
    run=_track_life,
    seconds=lambda settings: 1.0,
    told=_lives,
    from_recordings=False,
)


# --- all kinds, by the name that plans know them by -------------------------------------------------------------------

KINDS: dict[str, Kind] = {
    name: replace(kind, name=name)
    for name, kind in {
        "benchmark": BENCHMARK,
        "compare": COMPARE,
        "discover": DISCOVER,
        "fleets": FLEETS,
        "identify": IDENTIFY,
        "track": TRACK,
    }.items()
}

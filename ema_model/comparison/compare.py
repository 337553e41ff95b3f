"""Compares recordings with the model: floors, calibration, residuals, and what they say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.file import check_represents
from ema_model.actuator.parameters import path_inside
from ema_model.comparison.free_simulation import Simulated, in_open_loop, is_by_motion, scored
from ema_model.comparison.loop_lag import other_controller
from ema_model.comparison.residuals import UNKNOWN, OverFloor, by_signal, is_counted, residuals_of
from ema_model.comparison.result import Compared, Comparison, SignalError
from ema_model.comparison.verdict import judge, judged, silence
from ema_model.effects import find
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.estimation import Calibration, Floor, after_fit, floor, of_unseen, taken_up
from ema_model.estimation import calibrate as fit
from ema_model.estimation.noise import as_it_is, band, least, spread, tells_nothing, twin_errors
from ema_model.estimation.problem import SIGNALS
from ema_model.faults import checked, named
from ema_model.models import Model, Window, model_for
from ema_model.models.measured_motion import evaluation_stretches, fit_stretches, later, with_delay_of_drive
from ema_model.quantities import check_number
from ema_model.recordings import SIGNALS as SIGNAL_KINDS
from ema_model.recordings import Measurement
from ema_model.recordings.health import health_of
from ema_model.recordings.read import check_same_actuator, prepared
from ema_model.recordings.recording_set import check_held_out
from ema_model.recordings.side_file import stated
from ema_model.simulation.pack import compile_behind

Array = NDArray[np.float64]
Progress = Callable[[str], None]


def compare(
    measurements: Sequence[Measurement],
    actuator: Actuator | None = None,
    *,
    k: ArrayLike | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    calibrate: bool = True,
    free: Sequence[str] | None = None,
    signals: Sequence[str] | Mapping[str, float] | None = None,
    holdout: Sequence[Measurement] = (),
    on_progress: Progress | None = None,
) -> Comparison:
    """The recordings of one actuator beside its model.

    k: the actuator's faults (8,), in place of its file's; effects: besides the actuator's own.
    free: parameters to calibrate in place of those that the actuator's file leaves free; signals: to fit, in place of
    current and positions, with weights where it is a mapping (1 is what the signal's floor says).  holdout: recordings
    that are only held against the calibrated model, of which no more than their starts are fitted.
    on_progress is told what goes on, and may raise to stop.
    Raises InputError for recordings that cannot be compared, and for what is no k.
    """
    tell = on_progress or (lambda text: None)
    check_held_out(measurements, holdout)
    k = None if k is None else checked(k)
    return _compare(measurements, actuator or load_actuator(), k, effects, calibrate, free, signals, holdout, tell)


def _compare(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    k: ArrayLike | None,
    effects: Mapping[str, Mapping[str, float]] | None,
    calibrate: bool,
    free: Sequence[str] | None,
    signals: Sequence[str] | Mapping[str, float] | None,
    holdout: Sequence[Measurement],
    tell: Progress,
    elsewhere: tuple[Calibration, Array] | None = None,
) -> Comparison:
    """elsewhere: the calibration that these are held out of, and what it took up of the model's own error there."""
    check_same_actuator(measurements)
    tell("checking the data")
    recordings = [prepared(measurement, actuator) for measurement in measurements]
    unseen = [prepared(measurement, actuator) for measurement in holdout]
    cards = [health_of(measurement, actuator) for measurement in recordings]
    faults = actuator.faults if k is None else named(k)
    actuator = replace(actuator, effects=_with_settings(actuator, effects), faults=faults)
    wanted = weights_of(signals, actuator)
    if free is not None:
        free = [path_inside(path, actuator.tolerances, actuator.axes) for path in free]
    if calibrate and free is None:
        actuator = with_delay_of_drive(actuator, recordings)
    compile_behind(actuator)  # who compares an improved model does so again
    tell("measuring the model's floor")
    fitted = model_for(recordings, actuator, stretches=fit_stretches(recordings, actuator))
    sensors = [_stated(m, actuator) for m in measurements]
    floors = [floor(fitted, i, stated=sensors[window.recording]) for i, window in enumerate(fitted.windows)]
    tell("calibrating" if calibrate else "simulating")
    calibration = fit(
        fitted,
        floors,
        free=free if calibrate else (),
        signals=wanted,
        on_progress=lambda evaluations: tell(f"calibrating (simulations: {evaluations})"),
    )
    tell("looking where it fails")
    twins = twin_errors(fitted, calibration.actuator, calibration.k)
    taken = taken_up(floors, calibration, twins)
    if elsewhere is None:
        floors = after_fit(floors, calibration, twins, taken)
    else:
        floors = of_unseen(fitted, floors, *elsewhere, twins, wanted)
    plant, floors, before, after = _everywhere(recordings, fitted, floors, calibration, actuator)
    own = [as_it_is(draws) for draws in twins] if plant is fitted else [{} for _ in plant.windows]
    residuals = residuals_of(plant, floors, after, own, calibration.actuator, calibration if plant is fitted else None)
    told = residuals, plant.windows, floors
    compared = [
        _compared(i, recordings[i], cards[i], plant, floors, before, after, actuator, by_signal(*told, i))
        for i in range(len(recordings))
    ]
    errors = _together(compared, {actuator.axes.signal(name): one for name, one in by_signal(*told).items()})
    fitted_to = calibration.as_result if calibrate else None
    pooled = [judged(window.measured.keys() & one.keys()) for window, one in zip(plant.windows, after)]
    known_to = spread(floors, pooled)
    floor_band = band(known_to, least(floors, pooled))
    names = [one.name for one in recordings]
    judgement = judge(residuals, errors, fitted_to, actuator, names, known_to, floor_band)
    lag = other_controller(plant, fitted_to, before, judgement.over_floor)
    unsaid = [sentence for one in compared if (sentence := silence(one, actuator)) and not judgement.uninformative]
    held: Sequence[Compared] = ()
    held_floors: OverFloor | None = None
    if unseen:
        tell("holding it against what was not fitted")
        known = calibration, taken
        other = _compare(unseen, calibration.actuator, calibration.k, None, False, None, signals, (), tell, known)
        held, held_floors = other.recordings, other.in_floors
    simulation: Mapping[str, Simulated] = {}
    if elsewhere is None:
        tell("simulating it freely")
        simulation = _free(plant, recordings, unseen, compared, held, calibration.actuator)
    return Comparison(
        actuator=actuator,
        calibration=fitted_to,
        recordings=compared,
        residuals=judgement.residuals,
        signals=errors,
        primary=judgement.primary,
        explained_by=judgement.explained_by,
        orders=judgement.orders,
        worst_regions=judgement.worst_regions,
        events=judgement.events,
        adequate=judgement.adequate,
        uninformative=judgement.uninformative,
        over_floor=judgement.over_floor,
        floor_band=floor_band,
        sentences=[*([] if lag is None else [lag.blamed(fitted_to, judgement.over_floor)]), *judgement.sentences],
        warnings=[*judgement.warnings, *unsaid],
        holdout=held,
        unseen=held_floors,
        simulation=simulation,
    )


def _free(
    plant: Model,
    recordings: Sequence[Measurement],
    unseen: Sequence[Measurement],
    compared: Sequence[Compared],
    held: Sequence[Compared],
    calibrated: Actuator,
) -> dict[str, Simulated]:
    """The free simulation's errors, by signal: what a loop's model shows is one; a measured motion is put aside."""
    if is_by_motion(plant):
        found = in_open_loop(recordings, unseen, calibrated)
        return {calibrated.axes.signal(name): one for name, one in found.items()}

    def joined(parts: Sequence[Compared]) -> dict[str, tuple[Array, Array]]:
        names = dict.fromkeys(name for one in parts for name in one.errors)
        return {
            name: (
                np.concatenate([one.measured[name] for one in parts if name in one.errors]),
                np.concatenate([one.model[name] for one in parts if name in one.errors]),
            )
            for name in names
        }

    return scored(joined(compared), joined(held))


def _with_settings(
    actuator: Actuator, effects: Mapping[str, Mapping[str, float]] | None
) -> dict[str, dict[str, float]]:
    added = {name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()}
    for name in added:
        check_represents(actuator, name)
    return {**actuator.effects, **added}


def weights_of(signals: Sequence[str] | Mapping[str, float] | None, actuator: Actuator) -> dict[str, float]:
    """Weights by the signals' names inside."""
    if signals is None:
        return dict.fromkeys(SIGNALS, 1.0)
    known = {actuator.axes.signal(name): name for name in (*SIGNALS, "motor_speed_rad_s")}
    for name in signals:
        if name not in known:
            raise InputError(
                f"no signal {quoted(name)!r} to compare; there are {', '.join(known)}{did_you_mean(name, known)}"
            )
    weights = signals if isinstance(signals, Mapping) else dict.fromkeys(signals, 1.0)
    for name, weight in weights.items():
        check_number(weight, f"the weight of {name}")
        if not 0.0 < weight < np.inf:
            raise InputError(f"the weight of {name} must be a number above 0, not {weight:g}")
    return {known[name]: weight for name, weight in weights.items()}


def _stated(measurement: Measurement, actuator: Actuator) -> dict[str, dict[str, float]]:
    """What the side file says of the sensors, by the signal's name inside."""
    given = measurement.side.sensors
    return {
        name: {
            what: given[key]
            for what in ("noise", "accuracy")
            if (key := stated(actuator.axes.signal(name), what)) in given
        }
        for name in (*SIGNALS, "motor_speed_rad_s")
    }


def _everywhere(
    measurements: Sequence[Measurement],
    fitted: Model,
    floors: list[Floor],
    calibration: Calibration,
    actuator: Actuator,
) -> tuple[Model, list[Floor], list[dict[str, Array]], list[dict[str, Array]]]:
    """The whole recordings, where the fit took only parts of them."""
    if fit_stretches(measurements, actuator) is None:
        return fitted, floors, calibration.before, calibration.signals
    plant = model_for(measurements, actuator, stretches=evaluation_stretches(measurements, actuator))
    before, after, whole = [], [], []
    started = {(window.recording, window.first): i for i, window in enumerate(fitted.windows)}
    for place, window in enumerate(plant.windows):
        i = started.get((window.recording, window.first))
        for target, model, faults, start in (
            (before, actuator, actuator.k, (0.0, 0.0, 0.0, 0.0)),
            (after, calibration.actuator, calibration.k, calibration.start_of(i)),
        ):
            one = plant.signals(place, model, faults, *start)
            if target is after and f"lag {window.recording}" in calibration.starts:  # as its logger has it
                late = np.full((1, 1), calibration.starts[f"lag {window.recording}"].value)
                one["current_A"] = later(one["current_A"], late, window.block_s)
            target.append({name: values[0] for name, values in one.items()})
        parts = [one for its, one in zip(fitted.windows, floors) if its.recording == window.recording]
        whole.append(_typical_floor(parts, window))
    return plant, whole, before, after


def _typical_floor(floors: list[Floor], window: Window) -> Floor:
    """One for the whole recording, from those of its parts; what a grid holds where is the recording's own."""
    names, blocks = floors[0].noise, window.blocks

    def level(parts: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
        return {
            name: np.full(blocks, np.sqrt(np.mean([np.mean(one[name] ** 2) for one in parts]))) for name in parts[0]
        }

    return Floor(
        noise={name: float(np.median([one.noise[name] for one in floors])) for name in names},
        model=level([one.model for one in floors]),
        left=level([one.left for one in floors]),
        repeats=np.full(blocks, np.median([np.median(one.repeats) for one in floors])),
        block_s=floors[0].block_s,
        held_s=window.held_s,
        samples=window.samples_per_block,
        allowed=window.allowed,
        alike=window.alike,
        exact=floors[0].exact,
        even=floors[0].even,
    )


def _compared(
    index: int,
    measurement: Measurement,
    card,
    plant: Model,
    floors: Sequence[Floor],
    before: Sequence[dict[str, Array]],
    after: Sequence[dict[str, Array]],
    actuator: Actuator,
    over: Mapping[str, OverFloor],
) -> Compared:
    """over: the error in floors, by the signals' names inside."""
    chosen = [i for i, window in enumerate(plant.windows) if window.recording == index]
    windows = [plant.windows[i] for i in chosen]
    names = [name for name in windows[0].measured if name in after[chosen[0]]]

    def joined(parts: Sequence[Array]) -> Array:
        return np.concatenate(parts)

    measured = {name: joined([w.measured[name] for w in windows]) for name in names}
    initial = {name: joined([before[i][name] for i in chosen]) for name in names}
    model = {name: joined([after[i][name] for i in chosen]) for name in names}
    sigma = {name: joined([floors[i].sigma(name) for i in chosen]) for name in names}
    errors = {}
    for name in names:
        noise = joined([np.full(plant.windows[i].blocks, floors[i].noise[name]) for i in chosen])
        silent = tells_nothing(measured[name], name, noise, sigma[name])
        error = signal_error(measured[name], initial[name], model[name], sigma[name])
        about = float(np.mean(measured[name])) if SIGNAL_KINDS[name].kind == "position" else 0.0
        size = float(np.sqrt(np.mean((measured[name] - about) ** 2)))
        counted = is_counted(name, names)
        told = over.get(name, UNKNOWN)
        errors[name] = replace(error, signal_rms=size, silent=silent, in_floors=told, is_counted=counted)
    shown = actuator.axes.outside
    return Compared(
        name=measurement.name,
        measurement=measurement,
        health=card,
        time_s=joined([w.time_s for w in windows]),
        measured=shown(measured),
        initial=shown(initial),
        model=shown(model),
        sigma=shown(sigma),
        errors=shown(errors),
    )


def signal_error(measured: Array, initial: Array, model: Array, sigma: Array) -> SignalError:
    """How far a model is from a measured signal; all (n,)."""
    error = measured - model
    rmse = float(np.sqrt(np.mean(error**2)))
    spread = float(np.ptp(measured))
    return SignalError(
        rmse=rmse,
        rmse_initial=float(np.sqrt(np.mean((measured - initial) ** 2))),
        nrmse=rmse / spread if spread > 0.0 else float("nan"),
        noise_floor=float(np.sqrt(np.mean(sigma**2))),
        mean_absolute=float(np.mean(np.abs(error))),
    )


def _together(compared: Sequence[Compared], over: Mapping[str, OverFloor]) -> dict[str, SignalError]:
    """Of all recordings; over: the error in floors, by the signals' names."""
    found = {}
    for name in dict.fromkeys(name for one in compared for name in one.errors):
        having = [one for one in compared if name in one.errors]
        parts = ("measured", "initial", "model", "sigma")
        error = signal_error(*(np.concatenate([getattr(one, part)[name] for one in having]) for part in parts))
        silent = [one.errors[name].silent for one in having]
        sizes = [one.errors[name].signal_rms for one in having]
        weights = [len(one.time_s) for one in having]
        found[name] = replace(
            error,
            signal_rms=float(np.sqrt(np.average(np.square(sizes), weights=weights))),
            silent=silent[0] if all(silent) else "",
            in_floors=over.get(name, UNKNOWN),
            is_counted=all(one.errors[name].is_counted for one in having),
        )
    return found

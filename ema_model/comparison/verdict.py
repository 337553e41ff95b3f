"""What the residuals say: which signal to explain, by what, where it is worst, and whether anything is left at all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import on_axes
from ema_model.comparison.explain import Explanation, Order, explain, residual_orders, used_blocks
from ema_model.comparison.regions import Event, Region, events, worst_regions
from ema_model.comparison.residuals import (
    OPEN_LOOP,
    OverFloor,
    Residuals,
    dependence,
    is_counted,
    order_sentence,
    ratio,
)
from ema_model.comparison.result import Compared, SignalError
from ema_model.comparison.thresholds import BEYOND, SLOW
from ema_model.estimation import Calibration
from ema_model.estimation.noise import CONSTANT, CORRELATED_S, ORDER_OF_PRIMARY
from ema_model.quantities import Quantity, all_of, in_sentence, of_residual, of_signal
from ema_model.recordings import SIGNALS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Judgement:
    """The part of a `Comparison` that interprets."""

    residuals: Residuals
    primary: str
    explained_by: Sequence[Explanation]
    orders: Sequence[Order]
    worst_regions: Sequence[Region]
    events: Sequence[Event]
    adequate: bool
    uninformative: bool
    over_floor: float
    sentences: Sequence[str]
    warnings: Sequence[str]


def judge(
    residuals: Residuals,
    errors: Mapping[str, SignalError],
    calibration: Calibration | None,
    actuator: Actuator,
    recordings: Sequence[str] = (),
    spread: float = 0.0,
    floor_band: tuple[float, float] = (0.0, np.inf),
) -> Judgement:
    """Explains the residual of the first signal of interest, the current where it is measured, if it tells anything.

    recordings: their names, for what happened at one moment of one; spread: as of `most_of_floor`; floor_band: between
    which nine of ten true models' errors lie.
    """
    primary = next(name for name in ORDER_OF_PRIMARY if name in residuals.values)
    explained = explain(residuals, primary, actuator.axes)
    orders = residual_orders(residuals, primary)
    regions = worst_regions(residuals, primary, explained, actuator.axes, recordings)
    significant = [one for one in explained if one.significant]
    names = judged(residuals.values)
    error = over_floor(residuals, names)
    slow = lasting(residuals, names)
    within = error <= most_of_floor(spread) and not slow
    if errors[actuator.axes.signal(primary)].silent:
        warnings = _warnings(residuals, primary, calibration, actuator)
        return _nothing_told(residuals, errors, primary, actuator, error, warnings)
    adequate = not significant and within and (calibration is None or calibration.converged)
    shown = actuator.axes.signal(primary)
    happened = [] if adequate else events(residuals, names, recordings, actuator)
    sentences = [one.sentence for one in happened]
    if not adequate:
        where = [one.sentence for one in regions[:3]]
        if orders and significant and significant[0].variable == "motor_angle":
            where.insert(0, _order(orders[0], primary, residuals, actuator))
        # what is missing, then the statistic that bears it out
        sentences += [*where[:1], *(one.sentence for one in significant[:1]), *where[1:]]
    told = OverFloor(error, floor_band)
    if adequate:
        sentences.append(_explained(of_signal(primary, actuator.axes), errors[shown], told))
    else:
        why = "" if told.is_above else _yet_missing(significant, slow, calibration, actuator)
        but = f" Its size is that of noise, but {why}." if why else ""
        sentences.append(_off(of_signal(primary, actuator.axes), errors[shown]) + but)
    return Judgement(
        residuals=residuals,
        primary=shown,
        explained_by=explained,
        orders=orders,
        worst_regions=() if adequate else regions,
        events=happened,
        adequate=adequate,
        uninformative=False,
        over_floor=error,
        sentences=sentences,
        warnings=_warnings(residuals, primary, calibration, actuator),
    )


def _nothing_told(
    residuals: Residuals,
    errors: Mapping[str, SignalError],
    first: str,
    actuator: Actuator,
    over_floor: float,
    warnings: Sequence[str],
) -> Judgement:
    """Of recordings whose first signal tells nothing: no explanation, no region, and no word of a model that suits."""
    shown = actuator.axes.signal(first)
    why = silent_sentence(of_signal(first, actuator.axes), errors[shown])
    sentence = f"These recordings tell nothing of the model: {why}."
    return Judgement(residuals, shown, (), (), (), (), False, True, over_floor, [sentence], warnings)


def silent_sentence(signal: Quantity, error: SignalError) -> str:
    """'the equivalent current is no larger, 0.91 A rms, than its floor, 5.36 A'."""
    title, shown = in_sentence(signal.title), signal.scaled([error.signal_rms, error.noise_floor])
    if error.silent == CONSTANT:
        return f"the {title} does not change"
    size, floor = shown.text(error.signal_rms), shown.text(error.noise_floor)
    return f"the {title} is no larger, {size} rms, than what noise and the model's own floor may leave, {floor}"


def silence(one: Compared, actuator: Actuator) -> str:
    """That the first signal of one recording tells nothing; "" where it does."""
    inside = {actuator.axes.signal(name): name for name in ORDER_OF_PRIMARY}
    first = next((name for name in inside if name in one.errors), None)
    if first is None or not one.errors[first].silent:
        return ""
    why = silent_sentence(of_signal(first, actuator.axes), one.errors[first])
    return f"{one.name or 'The recording'} tells nothing of the model: {why}."


def judged(signals: Iterable[str]) -> list[str]:
    """Those whose error is pooled: a speed is mostly a position's difference, and counts where there is none."""
    names = list(signals)
    return [name for name in names if is_counted(name, names)]


def most_of_floor(spread: float) -> float:
    """The error in floors up to which a model is adequate; spread: as of `estimation.floor_band`."""
    return 1.0 + BEYOND * spread


def _order(order: Order, primary: str, residuals: Residuals, actuator: Actuator) -> str:
    """The strongest order, as a torque where the signal is a current."""
    return order_sentence(order.order, order.amplitude, of_residual(primary, actuator.axes, residuals.torque_constant))


def over_floor(residuals: Residuals, names: Sequence[str]) -> float:
    """rms of the residual over its floor, pooled over signals; where the drive is at its limits nothing is counted."""
    return ratio(residuals, names)


def lasting(residuals: Residuals, names: Sequence[str]) -> list[str]:
    """Signals of which more is left over 25 ms than their floor allows."""
    return [name for name in names if slow_ratio(residuals, name) > SLOW]


def slow_ratio(residuals: Residuals, name: str) -> float:
    """rms of the residual's means over 25 ms, over what noise and model floor give; a standstill counts once."""
    size = max(1, round(CORRELATED_S / residuals.block_s))
    used = np.isfinite(residuals.values[name]) & ~residuals.saturated
    values, sigma, white = residuals.values[name][used], residuals.sigma[name][used], residuals.white[name][used]
    count = values.size // size
    if count < 4:
        return 0.0

    def means(array: Array) -> Array:
        return array[: count * size].reshape(count, size).mean(axis=1)

    alike = np.ones_like(white) if residuals.alike is None else np.minimum(residuals.alike[used], size)
    floor = means(white**2 * alike) / size + means(sigma**2 - white**2)
    weights = means(_weights(residuals)[used])
    return float(np.sqrt(weights @ means(values) ** 2 / (weights @ floor)))


def _weights(residuals: Residuals) -> Array:
    """How much each block counts in a mean over time, (blocks,)."""
    return np.ones(residuals.blocks) if residuals.counts is None else residuals.counts


def _explained(signal: Quantity, error: SignalError, all_signals: OverFloor) -> str:
    """Of a model that is adequate; of one whose error is above the band no more than that."""
    shown = error.quantity(signal)
    size, floor, title = f"{shown.text(error.rmse)} rms", shown.text(error.noise_floor), in_sentence(signal.title)
    if all_signals.is_above or error.in_floors.is_above:
        left = f"the {title} is off by {size}, where noise and the model's own floor are {floor}"
        return f"A little more is left than noise explains, and no variable explains it: {left}."
    left = f"the residual {title}, {size}, is noise and the model's own floor ({floor})"
    return f"The model explains the recordings: {left}."


def _off(signal: Quantity, error: SignalError) -> str:
    shown = error.quantity(signal)
    size, floor = f"{shown.text(error.rmse)} rms", shown.text(error.noise_floor)
    return f"The {in_sentence(signal.title)} is off by {size}, where noise and the model's own floor are {floor}."


def _yet_missing(
    significant: Sequence[Explanation], slow: Sequence[str], calibration: Calibration | None, actuator: Actuator
) -> str:
    """Why a model is not adequate whose error is as small as a true model's."""
    if significant:
        return f"it goes with {dependence(significant[0].variable, significant[0].modulator)}"
    if slow:
        titles = [in_sentence(of_signal(name, actuator.axes).title) for name in slow]
        return f"that of the {all_of(titles)} lasts longer than noise"
    return "the calibration has not converged" if calibration is not None and not calibration.converged else ""


def _warnings(residuals: Residuals, primary: str, calibration: Calibration | None, actuator: Actuator) -> list[str]:
    found = [OPEN_LOOP] if actuator.controller.kind == "open" and not actuator.takes_voltage else []
    if used_blocks(residuals, primary) is None:
        title = in_sentence(SIGNALS[primary].title)
        found.append(f"Of the {title} too little can be judged: the motor stands, or the drive is at its limits.")
    if calibration is not None:
        if not calibration.converged:
            found.append("The calibration has not converged: what looks like missing physics may be an unfinished fit.")
        outside = [in_sentence(on_axes(name, actuator.axes).title) for name in calibration.outside_tolerance]
        if outside:
            found.append(
                f"At the edge of {'its' if len(outside) == 1 else 'their'} tolerance (3 σ): {', '.join(outside)}. "
                "Either a value is wrong, or it compensates for missing physics."
            )
    share = float(np.mean(residuals.saturated))
    if share > 0.005:
        found.append(f"The drive is at its limit for {100.0 * share:.2g} % of the time; these parts are not counted.")
    return found

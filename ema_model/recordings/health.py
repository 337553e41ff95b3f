"""The data health card: what a recording's own numbers say about its sampling, sensors, signs and limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.files.opened import listed, shown
from ema_model.quantities import SIGNALS, amount, in_sentence
from ema_model.recordings import signals as estimates
from ema_model.recordings.column_mapping import MappedColumn
from ema_model.recordings.measurement import PHASES, Measurement
from ema_model.recordings.signals import clock_drift, speed_lag
from ema_model.result import NULL, Result
from ema_model.text import Document, Lines

# --- one line of the data health card ---------------------------------------------------------------------------------

Severity = Literal["good", "note", "warning"]
MARKS: dict[Severity, str] = {"warning": "▲", "note": "●", "good": "✓"}  # before a sentence, the worst first


@dataclass(frozen=True)
class Finding:
    """What one check of a recording found."""

    check: Annotated[str, Meta(description="which one: sampling, noise, delay, …")]
    severity: Annotated[Severity, Meta(description="how much it matters")]
    sentence: Annotated[str, Meta(description="the finding in words, with its number and unit")]
    values: Annotated[
        dict[str, float], Meta(description="its numbers, units in the names; null: not known", extra=NULL)
    ] = field(default_factory=dict)
    signal: Annotated[str | None, Meta(description="of which signal; null: of the recording")] = None


# --- the checks of the data health card; each yields findings, or nothing where its signals are missing ---------------

Array = NDArray[np.float64]

_GAP = 3.0  # periods
# What a wrong unit makes of a speed.
_UNIT_FACTORS = {
    180.0 / np.pi: "in deg/s",
    30.0 / np.pi: "in rpm",
    1.0 / (2.0 * np.pi): "in turns per second",
    1000.0: "a thousandfold",
    1e-3: "a thousandth",
}


def sampling(measurement: Measurement) -> Iterator[Finding]:
    """Rate, jitter, gaps and duration."""
    steps = np.concatenate([np.diff(measurement.time_s[run]) for run in measurement.segments])
    if not steps.size:
        return
    period, runs = float(np.median(steps)), len(measurement.runs)
    length = f"{measurement.samples} samples over {measurement.duration_s:.4g} s"
    several = f" in {runs} runs" if runs > 1 else ""
    numbers = {"duration_s": measurement.duration_s, "samples": float(measurement.samples), "runs": float(runs)}
    yield Finding("duration", "good", f"{length}{several}.", numbers)
    usual = steps[steps < _GAP * period]
    jitter = float(np.std(usual)) / period if usual.size else 0.0
    severity = "good" if jitter < 0.01 else "note" if jitter < 0.3 else "warning"
    sentence = f"Sampled at {1.0 / period:.5g} Hz; the steps scatter by {100.0 * jitter:.2g} % rms of a period."
    yield Finding("rate", severity, sentence, {"rate_Hz": 1.0 / period, "jitter": jitter, "period_s": period})
    gaps = steps[steps >= _GAP * period]
    if gaps.size:
        sentence = (
            f"{gaps.size} gap{'s' * (gaps.size > 1)} of {_GAP:g} periods or more; the longest is {gaps.max():.4g} s."
        )
        severity = "warning" if gaps.sum() > 0.01 * measurement.duration_s else "note"
    else:
        sentence, severity = "No gaps.", "good"
    longest = float(gaps.max()) if gaps.size else 0.0
    yield Finding("gaps", severity, sentence, {"gaps": float(gaps.size), "longest_s": longest})


def sensors(measurement: Measurement) -> Iterator[Finding]:
    """Quantisation and noise of each measured signal."""
    for name in measurement:
        signal = SIGNALS.get(measurement.shown(name))
        if signal is None or signal.kind in ("time", "state") or name.startswith("command"):
            continue
        values = measurement[name]
        spread = float(np.std(values))
        if np.all(values == values[0]) or spread == 0.0:  # of numbers so small that their squares vanish
            yield Finding(
                "constant", "note", f"{signal.title} is constant, {amount(values[0], signal.unit)}.", {}, name
            )
            continue
        blocks = estimates.sample_blocks(values, measurement.runs)
        step = estimates.quantisation_step(blocks)
        if step:
            coarse = step > 0.05 * spread
            sentence = f"{signal.title} comes in steps of {amount(step, signal.unit)}."
            yield Finding("quantisation", "note" if coarse else "good", sentence, {"step": step}, name)
        noise = estimates.noise_rms(blocks)
        if measurement.is_map or not np.isfinite(noise):
            continue
        if noise < step / np.sqrt(12.0):
            sentence = f"{signal.title}: noise is below what its steps show, {amount(step, signal.unit)}."
        else:
            size = amount(noise, signal.unit)
            sentence = f"{signal.title}: noise about {size} rms, {100.0 * noise / spread:.2g} % of its spread."
        severity = "good" if noise < 0.1 * spread else "note" if noise < 0.5 * spread else "warning"
        yield Finding("noise", severity, sentence, {"noise_rms": noise, "spread": spread}, name)


def saturation(measurement: Measurement, limit: float | None) -> Iterator[Finding]:
    """How long the current is at its limit, which is given or seen as flat tops."""
    if "current_A" not in measurement:
        return
    values = measurement["current_A"]
    if limit:
        share = float(np.mean(np.abs(values) >= 0.98 * limit))
        sentence = f"The current is at its limit of {amount(limit, 'A')} for {100.0 * share:.3g} % of the time."
        severity = "good" if share < 0.001 else "note" if share < 0.1 else "warning"
        yield Finding("saturation", severity, sentence, {"share": share, "limit_A": limit}, "current_A")
        return
    noise = estimates.noise_rms(estimates.sample_blocks(values, measurement.runs))
    level, share = estimates.flat_tops(values, noise)
    if share:
        sentence = f"The current seems cut off at {amount(level, 'A')}, for {100.0 * share:.3g} % of the time."
        yield Finding("saturation", "note", sentence, {"share": share, "limit_A": level}, "current_A")
    else:
        sentence = "The current shows no flat tops, so no saturation is seen."
        yield Finding("saturation", "good", sentence, {"share": 0.0}, "current_A")


def delay(measurement: Measurement) -> Iterator[Finding]:
    """How much later the position moves than its command, and whether it does so the same way."""
    for kind in ("rad", "m"):
        command, response = f"command_{kind}", f"user_position_{kind}"
        if response not in measurement:
            response = f"motor_position_{kind}"
        if command not in measurement or response not in measurement:
            continue
        run = max(measurement.runs, key=lambda run: run.stop - run.start)
        if run.stop - run.start < 32:
            continue
        found, likeness = estimates.delay_s(
            measurement[command][run], measurement[response][run], measurement.time_s[run]
        )
        title = in_sentence(SIGNALS[response].title)
        values = {"delay_s": found, "correlation": likeness}
        if not abs(likeness) > 0.2:
            sentence = f"The delay from command to {title} cannot be told; their movements hardly agree."
            yield Finding("delay", "note", sentence, values, response)
            continue
        sentence = f"The {title} moves {1000.0 * found:.4g} ms after the command (correlation {likeness:.2f})."
        if likeness < 0.0:
            sentence = f"The {title} moves against the command ({1000.0 * found:.4g} ms after it): turn a sign."
        severity = "warning" if likeness < 0.0 or found < -2.0 * measurement.sample_period_s else "good"
        yield Finding("delay", severity, sentence, values, response)


def signs(measurement: Measurement) -> Iterator[Finding]:
    """Whether speed is the position's derivative, in sign and size, and user and motor turn the same way."""
    edges = estimates.window_edges(measurement.runs)
    for kind, rate in (("rad", "rad_s"), ("m", "m_s")):
        motor, user, speed = f"motor_position_{kind}", f"user_position_{kind}", f"motor_speed_{rate}"
        position = motor if motor in measurement else user
        if position in measurement and speed in measurement and edges:
            yield from _speed_sign(measurement, position, speed, edges)
        if motor in measurement and user in measurement and edges:
            yield from _gear(measurement, motor, user, edges)


def _speed_sign(
    measurement: Measurement, position: str, speed: str, edges: list[NDArray[np.intp]]
) -> Iterator[Finding]:
    moved = np.concatenate([estimates.changes_over(measurement[position], cut) for cut in edges])
    travelled = estimates.integrated(measurement[speed], measurement.time_s)
    expected = np.concatenate([estimates.changes_over(travelled, cut) for cut in edges])
    # The speed over the position's derivative, so that a speed in rpm reads 9.55.
    slope = estimates.slope(expected, moved)
    title = in_sentence(SIGNALS[position].title)
    values = {"ratio": slope.ratio, "correlation": slope.correlation}
    if not abs(slope.correlation) > 0.5:
        sentence = f"Motor speed and the derivative of the {title} hardly agree (correlation {slope.correlation:.2f})."
        yield Finding("speed", "warning" if np.any(moved) and np.any(expected) else "note", sentence, values, speed)
        return
    sentence = f"Motor speed is {slope.ratio:.4g} times the derivative of the {title}."
    hint = next((h for factor, h in _UNIT_FACTORS.items() if abs(abs(slope.ratio) / factor - 1.0) < 0.03), None)
    severity = "good"
    if position.startswith("user") and slope.ratio > 0.0:
        severity = "good" if abs(slope.ratio - 1.0) < 0.05 else "note"
    elif slope.ratio < 0.0:
        severity, sentence = "warning", f"{sentence} Their signs disagree: turn one."
    elif hint:
        severity, sentence = "warning", f"{sentence} It seems to be {hint}."
    elif abs(slope.ratio - 1.0) > 0.05:
        severity = "warning"
    yield Finding("speed", severity, sentence, values, speed)


def _gear(measurement: Measurement, motor: str, user: str, edges: list[NDArray[np.intp]]) -> Iterator[Finding]:
    turned, moved = (
        np.concatenate([estimates.changes_over(measurement[name], cut) for cut in edges]) for name in (motor, user)
    )
    slope = estimates.slope(turned, moved)
    if not abs(slope.correlation) > 0.5:
        return
    way = "the same way" if slope.ratio > 0.0 else "against each other"
    sentence = f"The motor moves {abs(slope.ratio):.4g} times as far as the user, {way}."
    severity = "good" if slope.ratio > 0.0 else "warning"
    yield Finding("gear", severity, sentence, {"ratio": slope.ratio, "correlation": slope.correlation}, user)


def phases(measurement: Measurement, pole_pairs: float | None) -> Iterator[Finding]:
    """Whether the phase currents add to zero, and in which order they follow the motor."""
    if not all(name in measurement for name in PHASES):
        return
    currents = np.array([measurement[name] for name in PHASES])
    rms = float(np.sqrt(np.mean(currents**2)))
    left = float(np.sqrt(np.mean(np.sum(currents, axis=0) ** 2)))
    if rms > 0.0:
        # The sensors' own noise does not cancel.
        noise = [estimates.noise_rms(estimates.sample_blocks(current, measurement.runs)) for current in currents]
        noisy = float(np.nan_to_num(np.linalg.norm(noise)))
        excess = max(0.0, left**2 - (1.2 * noisy) ** 2) ** 0.5
        severity = "good" if excess < 0.05 * rms else "note" if excess < 0.3 * rms else "warning"
        sum_, each = amount(left, "A"), amount(rms, "A")
        sentence = f"The three phase currents add to {sum_} rms, where zero is expected of {each} each."
        yield Finding("phase_sum", severity, sentence, {"sum_rms_A": left, "rms_A": rms})
    if "motor_position_rad" not in measurement:
        return
    angle = measurement["motor_position_rad"]
    pairs, forward, backward, offset = estimates.rotation_order(currents, angle, pole_pairs)
    values = {"pole_pairs": pairs, "a_b_c": forward, "a_c_b": backward, "rotor_offset_rad": offset}
    likeness = max(forward, backward)
    if not likeness > 0.3 or abs(forward - backward) < 0.1 * likeness or np.ptp(angle) * pairs < np.pi:
        sentence = "The order of the phases cannot be told; the motor turns too little or the currents too seldom."
        yield Finding("phase_order", "note", sentence, values)
    elif forward > backward:
        sentence = f"The phases follow the motor in the order A-B-C, with {pairs:g} pole pairs."
        yield Finding("phase_order", "good", sentence, values)
    else:
        values["rotor_offset_rad"] = float("nan")
        sentence = (
            f"The phases follow the motor in the order A-C-B ({pairs:g} pole pairs): swap two, or turn the angle."
        )
        yield Finding("phase_order", "warning", sentence, values)


def standstill(measurement: Measurement) -> Iterator[Finding]:
    """How much of the time nothing moves: below a hundredth of the fast speed over windows of a thousandth."""
    names = ("motor_position_rad", "user_position_rad", "motor_position_m", "user_position_m")
    name = next((name for name in names if name in measurement), None)
    edges = estimates.window_edges(measurement.runs)
    if name is None or not edges:
        return
    moved = np.concatenate([np.abs(estimates.changes_over(measurement[name], cut)) for cut in edges])
    lasted = np.concatenate([estimates.changes_over(measurement.time_s, cut) for cut in edges])
    speed = moved / lasted
    fast = float(np.quantile(speed, 0.98))
    share = float(np.sum(lasted[speed <= 0.01 * fast]) / np.sum(lasted))
    sentence = f"The axis stands still for {100.0 * share:.3g} % of the time."
    severity = "good" if share < 0.5 else "note" if share < 0.9 else "warning"
    yield Finding("standstill", severity, sentence, {"share": share}, name)


# --- what several clocks in one file mean for its signals, and how much later a speed comes than its position ---------
# A speed and the position that it is the derivative of tell a delay without a model.  A command and its response do
# not: the loop has a lag of its own; nor do a current and the acceleration, between which friction and the load stand.

_PAIRS = (("motor_position_rad", "motor_speed_rad_s"), ("motor_position_m", "motor_speed_m_s"))
_USUAL = 2.0  # periods, by which a speed that a drive makes of its encoder is late


def clocks(measurement: Measurement) -> Iterator[Finding]:
    """The clocks and how they were made one; the delay and drift that position and speed tell; what is not known."""
    read = measurement.reading.clocks
    names = [name for name in measurement if measurement.shown(name) in (read.of if read else ())]
    clock = {name: read.of[measurement.shown(name)] for name in names} if read else {}
    several = len(set(clock.values())) > 1
    if read and several:
        moved = listed(_title(measurement, name) for name in names if clock[name] != read.main)
        sentence = f"The file has {len(set(clock.values()))} clocks: brought onto one, {read.rule}: {moved}."
        yield Finding("clocks", "good", sentence, {"clocks": float(len(set(clock.values())))})
    known = set()
    for position, speed in _PAIRS:
        if position not in measurement or speed not in measurement:
            continue
        apart = several and clock.get(position) != clock.get(speed)
        found = _speed_delay(measurement, position, speed, apart)
        if found is not None:
            yield found
            if apart:
                yield from _drift(measurement, position, speed)
            known |= {clock.get(position), clock.get(speed)}
    if read and several:
        told = {read.main, *(known if read.main in known else ())}
        if unknown := [name for name in names if clock[name] not in told]:
            late = listed(_title(measurement, name) for name in unknown)
            why = "only a motor position and its speed tell a delay, where the motor moves to and fro"
            sentence = f"How much later or earlier than the rest their clocks put {late} is not known: {why}."
            yield Finding("clock_delay", "note", sentence)


def _speed_delay(measurement: Measurement, position: str, speed: str, apart: bool) -> Finding | None:
    """apart: whether the two have different clocks."""
    lag = speed_lag(measurement[position], measurement[speed], measurement.time_s, measurement.runs)
    if lag is None:
        return None
    values = {"delay_s": lag.lag_s, "delay_low_s": lag.low_s, "delay_high_s": lag.high_s}
    names = _title(measurement, speed), _title(measurement, position)
    interval = f"90 % interval {_ms(lag.low_s)} to {_ms(lag.high_s)} ms"
    if lag.low_s <= 0.0 <= lag.high_s:
        sentence = f"No delay is seen between {names[1]} and {names[0]}: {_ms(lag.lag_s)} ms, {interval}."
        return Finding("speed_delay", "good", sentence, values, speed)
    way = "after" if lag.lag_s > 0.0 else "before"
    sentence = f"The {names[0]} comes {_ms(abs(lag.lag_s))} ms {way} the {names[1]}'s derivative ({interval})"
    late = abs(lag.lag_s) > _USUAL * measurement.sample_period_s
    if not apart:
        return Finding("speed_delay", "note" if late else "good", f"{sentence}: delay or filter lag.", values, speed)
    sentence = (
        f"{sentence}: a delay between their clocks, or the lag of a filter. {_advice(measurement, speed, lag.lag_s)}"
    )
    return Finding("speed_delay", "warning" if late else "note", sentence, values, speed)


def _drift(measurement: Measurement, position: str, speed: str) -> Iterator[Finding]:
    """That their clocks do not run alike, where that is sure; what a delay taken out cannot take out."""
    drift = clock_drift(measurement[position], measurement[speed], measurement.time_s, measurement.runs)
    if drift is None or not drift.is_sure:
        return
    names, way = (_title(measurement, speed), _title(measurement, position)), "fast" if drift.rate > 0.0 else "slow"
    apart = abs(drift.rate) * float(np.ptp(measurement.time_s))
    sentence = (
        f"The {names[0]}'s clock runs {_ppm(abs(drift.rate))} ppm {way} against the {names[1]}'s (90 % interval "
        f"{_ppm(drift.low)} to {_ppm(drift.high)} ppm), {_ms(apart)} ms over the recording: fit shorter parts of it."
    )
    values = {"rate": drift.rate, "rate_low": drift.low, "rate_high": drift.high}
    severity = "warning" if apart > measurement.sample_period_s else "note"
    yield Finding("clock_drift", severity, sentence, values, speed)


def _advice(measurement: Measurement, speed: str, lag_s: float) -> str:
    name = measurement.shown(speed)
    entry = measurement.reading.mapping.get(name) or MappedColumn(name, name)
    late = replace(entry, delay_s=float(f"{entry.delay_s + lag_s:.3g}"))
    return f'If the speed\'s clock is the wrong one, --map "{shown(late.text, 200)}" takes it out.'


def _title(measurement: Measurement, name: str) -> str:
    signal = SIGNALS.get(measurement.shown(name))
    return in_sentence(signal.title) if signal else shown(name)


def _ppm(rate: float) -> str:
    return f"{1e6 * rate:.3g}".replace("-", "−")


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}".replace("-", "−")


# --- the data health card: what a recording's own numbers say about its sampling, sensors, signs and limits -----------

__all__ = ["Finding", "Health", "health", "health_of"]


@dataclass(frozen=True, repr=False)
class Health(Result):
    """The data health card of a recording."""

    name: Annotated[str, Meta(description="the recording's")]
    findings: Annotated[tuple[Finding, ...], Meta(description="in the order of the checks")] = field(
        default_factory=tuple
    )

    @property
    def severity(self) -> Annotated[Severity, Meta(description="the worst of all findings")]:
        """The worst of all findings."""
        worst = self.worst_first
        return worst[0].severity if worst else "good"

    @property
    def worst_first(self) -> list[Finding]:
        """All findings, warnings before notes."""
        rank = list(MARKS)
        return sorted(self.findings, key=lambda finding: rank.index(finding.severity))

    def of(self, check: str, signal: str | None = None) -> Finding | None:
        """The first finding of a check, such as "noise", of one signal where given."""
        fits = (f for f in self.findings if f.check == check and signal in (None, f.signal))
        return next(fits, None)


def health_of(measurement: Measurement, actuator: Actuator) -> Health:
    """The health card of a recording of this actuator."""
    limit: float | None = actuator.controller.current_limit_A
    if not np.isfinite(limit):  # a drive whose limit is not known
        limit = None
    return health(measurement, current_limit_A=limit, pole_pairs=actuator.motor.pole_pairs)


def health(
    measurement: Measurement, *, current_limit_A: float | None = None, pole_pairs: float | None = None
) -> Health:
    """The health card of a recording, by the names in files; checks whose signals are missing are left out.

    The current's limit is taken from the side file where it is not given; without one flat tops are sought.
    """
    limit = current_limit_A or measurement.side.sensors.get("current_limit_A")
    found = _findings(measurement, limit, pole_pairs)
    return Health(measurement.name, tuple(replace(f, signal=f.signal and measurement.shown(f.signal)) for f in found))


def _findings(measurement: Measurement, limit: float | None, pole_pairs: float | None) -> Iterator[Finding]:
    if not measurement.is_map:
        yield from sampling(measurement)
    yield from sensors(measurement)
    yield from saturation(measurement, limit)
    if measurement.is_map:
        return
    yield from delay(measurement)
    yield from clocks(measurement)
    yield from signs(measurement)
    yield from phases(measurement, pole_pairs)
    yield from standstill(measurement)


# --- a data health card in words: what is wrong first -----------------------------------------------------------------


def document_of(card: Health) -> Document:
    """A line for each finding, with its mark."""
    lines = [f"{MARKS[one.severity]} {one.sentence}" for one in card.worst_first]
    return Document([Lines(lines, f"Data health {card.name}")])

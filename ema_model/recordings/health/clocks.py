"""What several clocks in one file mean for its signals, and how much later a speed comes than its position.

A speed and the position that it is the derivative of tell a delay without a model.  A command and its response do not:
the loop has a lag of its own; nor do a current and the acceleration, between which friction and the load stand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ema_model.files.opened import listed, shown
from ema_model.quantities.signals import SIGNALS
from ema_model.quantities.titles import in_sentence
from ema_model.recordings.columns import MappedColumn
from ema_model.recordings.health.finding import Finding
from ema_model.recordings.health.speed_lag import clock_drift, speed_lag
from ema_model.recordings.measurement import Measurement

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

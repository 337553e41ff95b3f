"""Signals that a mapping says to come late, moved back to the time at which they were."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.columns.mapping import ColumnMapping
from ema_model.recordings.formats.clocks import between
from ema_model.recordings.measurement import Measurement


def without_delays(measurement: Measurement, mapping: ColumnMapping) -> Measurement:
    """The measurement with each delay of its mapping taken out, run by run, without the ends that one then lacks."""
    late = {entry.signal: entry.delay_s for entry in mapping.entries if entry.delay_s and entry.signal in measurement}
    if not late:
        return measurement
    parts: list[dict[str, np.ndarray]] = []
    for run in measurement.runs:
        time = measurement.time_s[run]
        whole = (time + min(0.0, *late.values()) >= time[0]) & (time + max(0.0, *late.values()) <= time[-1])
        part = {name: measurement[name][run] for name in measurement}
        for name, delay in late.items():
            part[name] = between(time + delay, time, part[name], SIGNALS[name].kind == "state")
        parts.append({name: values[whole] for name, values in part.items()})
    signals = {name: np.concatenate([part[name] for part in parts]) for name in measurement}
    told = tuple(f"{name} is moved {1e3 * delay:.6g} ms back, as its mapping says" for name, delay in late.items())
    return replace(measurement, signals=signals, notes=(*measurement.notes, *told))

"""A measurement in words: its size, how its file was read, and its signals with their ranges."""

from __future__ import annotations

import numpy as np

from ema_model.files.refusal import shown
from ema_model.quantities.numbers import number
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.measurement import Measurement
from ema_model.text import Document, Lines, Table


def document_of(measurement: Measurement) -> Document:
    """Signals by their names in files, in SI; beside each the column that it was read from."""
    size = f"{measurement.samples} samples"
    if not measurement.is_map:
        size += f" over {number(measurement.duration_s)} s"
    mapping = measurement.reading.mapping
    columns = {entry.signal: entry.column for entry in mapping.entries}
    rows, units, remarks = [], [], []
    for name, values in measurement.signals.items():
        outside = measurement.shown(name)
        rows.append([outside, number(float(np.min(values))), number(float(np.max(values)))])
        units.append(SIGNALS[outside].unit if outside in SIGNALS else "")
        remarks.append(f"from {shown(columns[outside])}" if columns.get(outside, outside) != outside else "")
    said = [measurement.reading.told, *(f"left aside: {shown(column)} ({why})" for column, why in mapping.unmapped)]
    beside = [f"{unit}   {remark}".strip() for unit, remark in zip(units, remarks)]
    return Document(
        [
            Lines([f"{measurement.name or 'recording'}: {size}", *filter(None, said)]),
            Table(("least", "most"), rows, "signal", beside),
        ]
    )

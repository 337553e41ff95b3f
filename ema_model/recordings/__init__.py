"""Recordings of a real or simulated actuator: signals on one time base, read, checked, resampled and written."""

from __future__ import annotations

from ema_model.quantities import SIGNALS, Signal
from ema_model.recordings.column_mapping import (
    ColumnMapping,
    MappedColumn,
    Reading,
    apply_mapping,
    guess_mapping,
    parse_mapping,
)
from ema_model.recordings.measurement import Measurement, can_have_current, with_equivalent_current
from ema_model.recordings.read import (
    check_needed,
    check_target,
    hints_of,
    prepared,
    read,
    read_columns,
    read_head,
    read_header,
    write_measurement,
)
from ema_model.recordings.side_file import (
    SideFile,
    change_side_file,
    check_one_actuator,
    find_side_file,
    read_side_file,
    side_path,
    write_side_file,
)

__all__ = [
    "SIGNALS",
    "ColumnMapping",
    "MappedColumn",
    "Measurement",
    "Reading",
    "SideFile",
    "Signal",
    "apply_mapping",
    "can_have_current",
    "change_side_file",
    "check_needed",
    "check_one_actuator",
    "check_target",
    "find_side_file",
    "guess_mapping",
    "hints_of",
    "parse_mapping",
    "prepared",
    "read",
    "read_columns",
    "read_head",
    "read_header",
    "read_side_file",
    "side_path",
    "with_equivalent_current",
    "write_measurement",
    "write_side_file",
]

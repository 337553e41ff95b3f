"""Writing recordings: CSV and Parquet, whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from ema_model.errors import InputError
from ema_model.measurement.measurement import Measurement


def write_measurement(measurement: Measurement, path: str | Path) -> None:
    """Writes a .csv or .parquet file, replacing one that is there only when all is written."""
    path = Path(path)
    check_target(path)
    table = pa.table({name: pa.array(values) for name, values in measurement.signals.items()})
    handle, draft = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
    os.close(handle)
    try:
        if path.suffix.lower() == ".csv":
            pa.csv.write_csv(table, draft, pa.csv.WriteOptions(quoting_style="none"))
        else:
            pa.parquet.write_table(table.replace_schema_metadata({"emaviz_schema": "1"}), draft)
        os.chmod(draft, 0o644)
        os.replace(draft, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(draft)
        if isinstance(error, OSError):
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
        raise


def check_target(path: Path) -> None:
    """InputError unless a recording can be written there."""
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise InputError(f"{path}: write to a .csv or .parquet file")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file in it")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: no permission to write in {path.parent}")

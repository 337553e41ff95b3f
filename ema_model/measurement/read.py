"""Reading recordings: CSV and Parquet, checked, refused in one clear line."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from ema_model.errors import InputError
from ema_model.measurement.measurement import Measurement
from ema_model.measurement.signals import SIGNALS

FEWEST_SAMPLES = 100
MAX_BYTES = 2_000_000_000


def read_measurement(path: str | Path, *, max_bytes: int = MAX_BYTES) -> Measurement:
    """The recording in a .csv or .parquet file; InputError says in one line what is wrong with it.

    Columns that are not canonical are left out, with a note; a name that only lacks its unit is refused.
    """
    path = Path(path)
    _check_file(path, max_bytes)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        table, first_row = _read_csv(path), 2
    elif suffix == ".parquet":
        table, first_row = _read_parquet(path), 1
    else:
        raise InputError(f"{path}: a .csv or .parquet file is expected, not {suffix or 'a name without suffix'}")
    names = [name.strip() for name in table.column_names]
    _check_names(path, names)
    notes = []
    ignored = [name for name in names if name not in SIGNALS]
    if ignored:
        notes.append(f"columns not used: {', '.join(ignored)}")
    if table.num_rows < FEWEST_SAMPLES:
        raise InputError(f"{path}: only {table.num_rows} samples; {FEWEST_SAMPLES} or more are needed")
    signals = {
        name: _numbers(path, name, table.column(i), first_row) for i, name in enumerate(names) if name in SIGNALS
    }
    _check_time(path, signals, first_row)
    return Measurement(signals, name=path.stem, notes=tuple(notes))


def _check_file(path: Path, max_bytes: int) -> None:
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a .csv or .parquet file in it")
    try:
        size = path.stat().st_size
        with path.open("rb"):
            pass
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if size == 0:
        raise InputError(f"{path}: is empty; a header line and {FEWEST_SAMPLES} samples or more are expected")
    if size > max_bytes:
        raise InputError(
            f"{path}: {size / 1e9:.2f} GB is over the limit of {max_bytes / 1e9:.2f} GB; cut it or thin it"
        )


def _read_parquet(path: Path) -> pa.Table:
    try:
        return pa.parquet.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path}: not a readable Parquet file ({_one_line(error)})") from None


def _read_csv(path: Path) -> pa.Table:
    with path.open("rb") as file:
        start = file.read(65536)
    if b"\0" in start:
        raise InputError(f"{path}: is not text; a CSV file with a header line is expected")
    header = start.decode("utf-8-sig", errors="replace").splitlines()[0] if start.strip() else ""
    if not header.strip():
        raise InputError(f"{path}: line 1 must be a header with the columns' names, e.g. time_s,command_rad,current_A")
    delimiter = ";" if header.count(";") > header.count(",") else ","
    if all(_is_number(cell) for cell in header.split(delimiter)):
        raise InputError(f"{path}: line 1 holds numbers; a header is expected, e.g. time_s,command_rad,current_A")
    try:
        return pa.csv.read_csv(
            path,
            parse_options=pa.csv.ParseOptions(delimiter=delimiter),
            convert_options=pa.csv.ConvertOptions(null_values=[], strings_can_be_null=False),
        )
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise InputError(
            _what_is_ragged(path, delimiter) or f"{path}: not a readable CSV ({_one_line(error)})"
        ) from None


def _what_is_ragged(path: Path, delimiter: str) -> str | None:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        rows = csv.reader(file, delimiter=delimiter)
        try:
            width = len(next(rows))
            for row in rows:
                if row and len(row) != width:
                    return f"{path}: line {rows.line_num} has {len(row)} cells, the header has {width}"
        except (csv.Error, StopIteration):
            pass
    return None


def _check_names(path: Path, names: list[str]) -> None:
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise InputError(f"{path}: column {sorted(twice)[0]!r} appears twice")
    if "time_s" not in names:
        like = next(
            (n for n in names if n.lower() in ("t", "time", "time_ms", "time_us", "timestamp", "seconds")), None
        )
        hint = f"; is it {like!r}? give it in seconds and name it time_s" if like else ""
        raise InputError(f"{path}: no column time_s among {_shown(names)}{hint}")
    for name in names:
        if name in SIGNALS:
            continue
        plain = name.lower().split("[")[0].split("(")[0].strip().replace(" ", "_")
        for signal in SIGNALS.values():
            bare = signal.name.removesuffix("_" + signal.name.split("_", 2)[-1]) if signal.unit else signal.name
            without_unit = _without_unit(signal.name)
            if signal.unit and plain in (without_unit, without_unit.split("_")[-1], bare) and plain != "time":
                raise InputError(
                    f"{path}: column {name!r} has no unit in its name; if it is in {signal.unit}, name it {signal.name}"
                )


def _without_unit(name: str) -> str:
    for unit in ("_rad_s", "_rad", "_Nm", "_A", "_V", "_C", "_s"):
        if name.endswith(unit):
            return name.removesuffix(unit)
    return name


def _numbers(path: Path, name: str, column: pa.ChunkedArray, first_row: int) -> np.ndarray:
    where = "line" if first_row == 2 else "row"
    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type) or pa.types.is_boolean(column.type)):
        cells = column.to_pylist()
        at = next((i for i, cell in enumerate(cells) if not _is_number(str(cell))), 0)
        cell = str(cells[at])
        what = "is empty" if not cell.strip() else f"holds {cell[:40]!r}"
        raise InputError(f"{path}: {where} {at + first_row}, column {name} {what}; a number is expected")
    values = column.cast(pa.float64()).to_numpy()
    bad = ~np.isfinite(values)
    if bad.any():
        at = int(np.argmax(bad))
        raise InputError(
            f"{path}: {where} {at + first_row}, column {name} is {values[at]}; remove or repair such samples"
        )
    return values


def _check_time(path: Path, signals: dict[str, np.ndarray], first_row: int) -> None:
    where = "line" if first_row == 2 else "row"
    step = np.diff(signals["time_s"])
    if "segment" in signals:
        step = np.where(np.diff(signals["segment"]) != 0.0, 1.0, step)
    if np.any(step <= 0.0):
        at = int(np.argmax(step <= 0.0)) + 1
        t = signals["time_s"]
        raise InputError(
            f"{path}: {where} {at + first_row}, time_s goes from {t[at - 1]:g} to {t[at]:g}; it must increase in every row"
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _shown(names: list[str]) -> str:
    shown = ", ".join(name[:30] for name in names[:8])
    return shown + (", …" if len(names) > 8 else "")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:160]

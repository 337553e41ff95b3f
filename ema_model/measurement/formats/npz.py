"""NumPy's .npz: one array per signal; a structured array gives a column per field."""

from __future__ import annotations

import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.lib import format as npy

from ema_model.errors import InputError
from ema_model.measurement.formats.arrays import (
    Kind,
    as_columns,
    check_column,
    check_size,
    column_names,
    is_column,
)
from ema_model.measurement.formats.format import Array, Columns, Format
from ema_model.measurement.refusal import refusal, shown


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the arrays' own headers are read
    with _opened(path) as archive:
        return column_names({name: kind for name, (kind, _, _) in _contents(archive).items()})


def _read(path: str, names: Sequence[str], max_bytes: int) -> Columns:
    with _opened(path) as archive:
        contents = _contents(archive)
        kinds = {name: kind for name, (kind, _, _) in contents.items()}
        for name in names:
            check_column(path, name, kinds[name])
        check_size(path, kinds, names, max_bytes)
        arrays = {}
        for name in names:
            _, member, field = contents[name]
            with archive.open(member) as file:
                values = npy.read_array(file, allow_pickle=False)
            arrays[name] = values if field is None else values[field]
    return as_columns(path, arrays, [name for name, kind in kinds.items() if not is_column(kind)])


def _write(signals: Mapping[str, Array], path: str) -> None:
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=False, **signals)


def _contents(archive: zipfile.ZipFile) -> dict[str, tuple[Kind, str, str | None]]:
    """What each column is, the archive's member that holds it, and the field in there."""
    contents: dict[str, tuple[Kind, str, str | None]] = {}
    for member in archive.namelist():
        if not member.endswith(".npy"):
            continue
        with archive.open(member) as file:
            version = npy.read_magic(file)
            if version == (1, 0):
                shape, _, dtype = npy.read_array_header_1_0(file)
            else:
                shape, _, dtype = npy.read_array_header_2_0(file)
        name = member.removesuffix(".npy")
        if dtype.names is None:
            contents[name] = ((shape, dtype), member, None)
        for field in dtype.names or ():
            label = field if field not in contents else f"{name}.{field}"
            contents[label] = ((shape, dtype[field]), member, field)
    return contents


@contextmanager
def _opened(path: str) -> Iterator[zipfile.ZipFile]:
    """The archive; what cannot be read in it becomes an InputError."""
    with open(path, "rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of old headers, to which nobody can attend
        try:
            with zipfile.ZipFile(file) as archive:
                yield archive
        except (InputError, MemoryError):
            raise
        except Exception as error:  # a damaged archive fails in as many ways as there are layers below
            raise refusal(path, f"is not a whole .npz file ({shown(error, 80)}); save it again") from None


FORMAT = Format(".npz", "NumPy", _header, _read, _write)

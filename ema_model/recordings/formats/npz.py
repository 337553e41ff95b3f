"""NumPy's .npz: one array per signal; a structured array gives a column per field."""

from __future__ import annotations

import math
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.lib import format as npy

from ema_model.errors import InputError
from ema_model.recordings.formats.arrays import (
    Kind,
    as_columns,
    check_column,
    check_size,
    column_names,
    is_column,
    unpacks_to,
)
from ema_model.recordings.formats.format import Array, Columns, Format
from ema_model.recordings.refusal import refusal, shown

_ENCRYPTED = 0x1  # of a member's flags


class _Place(NamedTuple):
    """Where a column is: the archive's member, its size in memory, and the field in it or None."""

    kind: Kind
    member: str
    member_bytes: int
    field: str | None


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the arrays' own headers are read
    with _opened(path) as archive:
        return column_names({name: place.kind for name, place in _contents(path, archive).items()})


def _read(path: str, names: Sequence[str], max_bytes: int) -> Columns:
    with _opened(path) as archive:
        places = _contents(path, archive)
        kinds = {name: place.kind for name, place in places.items()}
        for name in names:
            check_column(path, name, kinds[name])
        check_size(path, kinds, names, max_bytes)
        # A structured array is read whole, whatever its other fields hold.
        members = {places[name].member: places[name].member_bytes for name in names}
        if sum(members.values()) > max_bytes:
            raise unpacks_to(path, sum(members.values()), max_bytes)
        whole = {}
        for member in members:
            with archive.open(member) as file:
                whole[member] = npy.read_array(file, allow_pickle=False)
        arrays = {name: _field(whole[places[name].member], places[name].field) for name in names}
    return as_columns(path, arrays, [name for name, kind in kinds.items() if not is_column(kind)])


def _write(signals: Mapping[str, Array], path: str) -> None:
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=False, **signals)


def _field(array: np.ndarray, field: str | None) -> np.ndarray:
    return array if field is None else array[field]


def _contents(path: str, archive: zipfile.ZipFile) -> dict[str, _Place]:
    """Where each column is; a field whose name another array has is called `array.field`."""
    members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
    if any(info.flag_bits & _ENCRYPTED for info in members):
        raise refusal(path, "is encrypted; save it again without a password")
    twice = [name for name, count in Counter(info.filename for info in members).items() if count > 1]
    if twice:
        raise refusal(path, f"array {shown(twice[0])!r} stands twice; save it again with one of each name")
    contents: dict[str, _Place] = {}
    structured: list[_Place] = []
    for info in members:
        shape, dtype = _array_header(archive, info)
        size = math.prod(shape) * dtype.itemsize
        if dtype.names is None:
            contents[info.filename.removesuffix(".npy")] = _Place((shape, dtype), info.filename, size, None)
        for field in dtype.names or ():
            structured.append(_Place((shape, dtype[field]), info.filename, size, field))
    for place in structured:
        field = str(place.field)
        contents[field if field not in contents else f"{place.member.removesuffix('.npy')}.{field}"] = place
    return contents


def _array_header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Kind:
    with archive.open(info) as file:
        read = npy.read_array_header_1_0 if npy.read_magic(file) == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read(file)
    return shape, dtype


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

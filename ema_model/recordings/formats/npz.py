"""NumPy's .npz: one array per signal; a structured array gives a column per field."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.lib import format as npy

from ema_model.errors import InputError
from ema_model.files.limits import ARRAYS
from ema_model.files.refusal import refusal, shown
from ema_model.files.safe_zip import Damaged, Member, Refused, SafeZip, opened_zip
from ema_model.recordings.formats.arrays import Kind, column_names, take
from ema_model.recordings.formats.format import Array, Columns, Format, check_size

_SUFFIX = ".npy"
_HEAD_BYTES = 20_000  # numpy takes headers of up to 10,000, but reads them to their declared end first
_FAR_TOO_MANY = 2**62  # beyond which numpy cannot count; a header may have thousands of digits


class _Place(NamedTuple):
    """Where a column is: the archive's member, its size in memory, and the field in it or None."""

    kind: Kind
    member: str
    member_bytes: int
    field: str | None


def _header(path: str, max_bytes: int) -> list[str]:
    with _opened(path, max_bytes) as archive:
        return column_names({name: place.kind for name, place in _contents(path, archive).items()})


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    with _opened(path, max_bytes) as archive:
        places = _contents(path, archive)
        whole: dict[str, np.ndarray] = {}

        def values(name: str) -> np.ndarray:
            place = places[name]
            if place.field is None:
                return _array(path, archive, place.member)
            # A structured array is read whole, whatever its other fields hold.
            if place.member not in whole:
                whole[place.member] = _array(path, archive, place.member)
            return whole[place.member][place.field]

        members = {places[name].member: places[name].member_bytes for name in names if places[name].field is not None}
        check_size(path, sum(members.values()) / 8, max_bytes)
        return take(path, {name: place.kind for name, place in places.items()}, names, max_bytes, strict, values)


def _write(signals: Mapping[str, Array], path: str) -> None:
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=False, **signals)


def _contents(path: str, archive: SafeZip) -> dict[str, _Place]:
    """Where each column is; a field whose name another array has is called `array.field`."""
    contents: dict[str, _Place] = {}
    structured: list[_Place] = []
    for member in archive.names:
        if not member.endswith(_SUFFIX):
            continue
        with archive.open(member) as file, _npy(path):
            shape, dtype = _array_header(file)
        size = math.prod(shape) * dtype.itemsize
        if dtype.names is None:
            contents[member.removesuffix(_SUFFIX)] = _Place((shape, dtype), member, size, None)
        for field in dtype.names or ():
            structured.append(_Place((shape, dtype[field]), member, size, field))
    for place in structured:
        field = str(place.field)
        contents[field if field not in contents else f"{place.member.removesuffix(_SUFFIX)}.{field}"] = place
    return contents


def _array_header(file: Member) -> Kind:
    head = io.BytesIO(file.read(_HEAD_BYTES))
    read = npy.read_array_header_1_0 if npy.read_magic(head) == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(head)
    if any(size >= _FAR_TOO_MANY for size in shape):
        raise ValueError("no array is that long")
    return shape, dtype


def _array(path: str, archive: SafeZip, member: str) -> np.ndarray:
    with archive.open(member) as file, _npy(path):
        return npy.read_array(file, allow_pickle=False)  # type: ignore  it asks for no more than `read`


@contextmanager
def _npy(path: str) -> Iterator[None]:
    """Around numpy's reading of an array; what it cannot read becomes an InputError."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of old headers, to which nobody can attend
        try:
            yield
        except (Damaged, Refused, MemoryError):
            raise
        except Exception as error:  # the header is a Python expression, which fails in any way
            raise _not_whole(path, error) from None


@contextmanager
def _opened(path: str, max_bytes: int) -> Iterator[SafeZip]:
    """The archive; what cannot be read in it becomes an InputError."""
    with open(path, "rb") as file:
        try:
            with opened_zip(file, ARRAYS, max_bytes) as archive:
                yield archive
        except Damaged as error:
            raise _not_whole(path, error) from None
        except Refused as error:
            raise refusal(path, f"{error}; save it again as numpy.savez does, in parts if it is large") from None


def _not_whole(path: str, error: Exception) -> InputError:
    return refusal(path, f"is not a whole .npz file ({shown(error, 80)}); save it again")


FORMAT = Format(".npz", "NumPy", _header, _read, _write)

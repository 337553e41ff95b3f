"""NumPy's files: an archive of arrays (.npz), and one array (.npy)."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.files.opened import ARRAYS, Damaged, Member, Refused, SafeZip, listed, opened_zip, refusal, shown
from ema_model.quantities import SIGNALS
from ema_model.recordings.column_names import is_time
from ema_model.recordings.formats.channels import (
    Channel,
    Log,
    Matrix,
    NoLog,
    broken_file,
    check_lengths,
    column_names_of,
    in_columns,
    log_format,
    offered,
    taken,
    times_of,
    way_of_time,
    with_own_clocks,
    with_runs,
    without_columns,
    without_ones,
)
from ema_model.recordings.formats.format import Array, Columns, Format, check_size

# --- named arrays of any shape, as .npz and .mat files hold them, turned into columns ---------------------------------

Shape = tuple[int, ...]
Kind = tuple[Shape, np.dtype[Any]]


def is_column(kind: Kind) -> bool:
    """Whether it holds two or more real numbers in a row or a column: (n,), (n, 1) or (1, n)."""
    shape, dtype = kind
    return dtype.kind in "fiub" and np.prod(shape, dtype=float) > 1 and len(without_ones(shape)) == 1


def column_names(path: str, kinds: Mapping[str, Kind]) -> list[str]:
    """The names to offer as columns; InputError where there is none.

    Scalars, images and text are left aside, since such files hold parameters and labels too; under a
    canonical name they stay, so that reading them says what is wrong with them.
    """
    names = [name for name, kind in kinds.items() if is_column(kind) or name in SIGNALS]
    if not names:
        aside = f" ({listed(_aside(kinds))})" if kinds else ""
        raise refusal(path, f"holds no rows of numbers{aside}; a time and its signals are expected")
    return names


def _aside(kinds: Mapping[str, Kind]) -> list[str]:
    """What holds no columns, as a message calls it."""
    return [
        without_columns(name, shape)
        if dtype.kind in "fiub" and len(shape) > 1 and np.prod(shape, dtype=float) > 1
        else name
        for name, (shape, dtype) in kinds.items()
        if not is_column((shape, dtype))
    ]


def check_column(path: str, name: str, kind: Kind) -> None:
    """Raises InputError for what is no column of numbers."""
    shape, dtype = kind
    if dtype.kind not in "fiub":
        found = {"U": "text", "S": "text", "c": "complex numbers", "M": "dates", "O": "objects"}.get(
            dtype.kind, "no numbers"
        )
        raise refusal(path, f"column {shown(name)!r} holds {found}; real numbers are expected, store it as double")
    if 0 in shape:
        raise refusal(path, f"column {shown(name)!r} is empty; fill or remove it")
    if not is_column(kind):
        raise refusal(path, f"column {shown(name)!r} is {sizes(shape)}; one vector of numbers per signal is expected")


def sizes(shape: Shape) -> str:
    """A shape as people write it: "3×4"."""
    return "×".join(str(size) for size in shape) or "a single value"


def take(
    path: str,
    kinds: Mapping[str, Kind],
    names: Sequence[str],
    max_bytes: int,
    strict: bool,
    values: Callable[[str], NDArray[Any]],
) -> Columns:
    """The columns asked for as float64; `values` gives each.  Unless `strict`, only those that are columns.

    Raises InputError for what is no column, takes too much memory, or has another length than the first.
    """
    if strict:
        for name in names:
            check_column(path, name, kinds[name])
    else:
        names = [name for name in names if is_column(kinds[name])]
    check_size(path, sum(np.prod(kinds[name][0], dtype=float) for name in names), max_bytes)
    columns: dict[str, Array] = {}
    with np.errstate(over="ignore"):  # an infinite value is told later, with its place
        for name in names:
            # Aligned, of this machine's byte order, and not a copy where it is so already.
            columns[name] = np.require(values(name).reshape(-1), np.float64, ["C", "A"])
    if strict:
        check_lengths(path, columns)
    aside = _aside(kinds)
    notes = (f"left aside, as they are no columns of numbers: {listed(aside)}",) if aside else ()
    return Columns(columns, lambda row: f"sample {row + 1}", notes)


def put_together(channels: Sequence[Channel], aside: Sequence[str]) -> Log | None:
    """The columns as a log, where they have several clocks or are several runs; else nothing."""
    log = Log(channels, left_aside=tuple(aside))
    found = with_own_clocks(with_runs(log))
    return None if found is log else found


def together(path: str, log: Log, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    """Columns of such a log on one clock; raises InputError as a format's `read` does."""
    arrays, notes, clocks = taken(path, log, names, max_bytes, strict)
    if strict:
        check_lengths(path, arrays)
    aside = [f"left aside, as they are no columns of numbers: {listed(log.left_aside)}"] if log.left_aside else []
    return Columns(arrays, lambda row: f"sample {row + 1}", (*aside, *log.notes, *notes), clocks=clocks)


# --- numPy's .npz: one array per signal; a structured array gives a column per field ----------------------------------

_SUFFIX = ".npy"
_HEAD_BYTES = 20_000  # numpy takes headers of up to 10,000, but reads them to their declared end first
_FAR_TOO_MANY = 2**62  # beyond which numpy cannot count; a header may have thousands of digits


class _Place(NamedTuple):
    """Where a column is: the archive's member, its size in memory, the field in it or None, and the part of that."""

    kind: Kind
    member: str
    member_bytes: int
    field: str | None
    size: Shape = ()  # of a matrix, without sizes of one; the columns' kind is that of one of them
    part: tuple[slice | int, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether it is all that its member holds."""
        return self.field is None and not self.part


def _header(path: str, max_bytes: int) -> list[str]:
    with _opened(path, max_bytes) as archive:
        places = _contents(path, archive)
        kinds = {name: place.kind for name, place in places.items()}
        log = _log(path, archive, places, kinds, max_bytes)
        return list(offered(path, log)) if log else column_names(path, kinds)


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    with _opened(path, max_bytes) as archive:
        places = _contents(path, archive)
        kinds = {name: place.kind for name, place in places.items()}
        if log := _log(path, archive, places, kinds, max_bytes):
            return together(path, log, names, max_bytes, strict)
        # A structured array is read whole, whatever its other fields hold, and so is a matrix.
        members = {places[name].member: places[name].member_bytes for name in names if not places[name].is_whole}
        check_size(path, sum(members.values()) / 8, max_bytes)
        return take(path, kinds, names, max_bytes, strict, _values(path, archive, places, max_bytes))


def _values(path: str, archive: SafeZip, places: Mapping[str, _Place], max_bytes: int) -> Callable[[str], np.ndarray]:
    whole: dict[str, np.ndarray] = {}

    def values(name: str) -> np.ndarray:
        place = places[name]
        check_size(path, place.member_bytes / 8, max_bytes)
        if place.is_whole and not is_time(name):  # a time is looked at before it is read
            return _array(path, archive, place.member)
        if place.member not in whole:
            whole[place.member] = _array(path, archive, place.member)
        array = whole[place.member] if place.field is None else whole[place.member][place.field]
        return array.reshape(place.size)[place.part] if place.part else array

    return values


def _log(
    path: str, archive: SafeZip, places: Mapping[str, _Place], kinds: Mapping[str, Kind], max_bytes: int
) -> Log | None:
    values = _values(path, archive, places, max_bytes)
    channels = [
        Channel((name,), math.prod(kind[0]), lambda name=name: values(name))
        for name, kind in kinds.items()
        if is_column(kind)
    ]
    return put_together(channels, _aside(kinds))


def _write(signals: Mapping[str, Array], path: str) -> None:
    with open(path, "wb") as file:
        np.savez(file, allow_pickle=False, **signals)


def _contents(path: str, archive: SafeZip) -> dict[str, _Place]:
    """Where each column is; a field whose name another array has is called `array.field`, so is a matrix's column."""
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
    return _in_columns(contents)


def _in_columns(contents: Mapping[str, _Place]) -> dict[str, _Place]:
    """The same, each matrix that holds signals as these."""
    times = times_of((name, math.prod(place.kind[0])) for name, place in contents.items() if is_column(place.kind))
    found: dict[str, _Place] = {}
    for name, place in contents.items():
        shape, dtype = place.kind
        size = without_ones(shape)
        way = None if name in SIGNALS or dtype.kind not in "fiub" else way_of_time(size, times)
        if way is None:
            found[name] = place
            continue
        for i, column in enumerate(column_names_of(name, size[1 - way])):
            part = (slice(None), i) if way == 0 else (i,)
            unique = column if column not in contents else f"{name}.{column}"
            found[unique] = place._replace(kind=((size[way],), dtype), size=size, part=part)
    return found


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


NPZ = Format(".npz", "NumPy", _header, _read, _write)


# --- one array: a structured one gives a column per field, a matrix its columns ---------------------------------------


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The array's columns; NoLog for what is none."""
    del most_bytes  # a map of the file is no larger than the file
    with broken_file():  # the header is a Python expression, which fails in any way
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.memmap):
        raise NoLog("it is no array of numbers")
    yield Log(_channels(path, array))


def _channels(path: str, array: Any) -> list[Channel]:
    if array.dtype.names:
        rows = array.reshape(-1)
        kinds = {name: array.dtype[name] for name in array.dtype.names}
        return [
            Channel((name,), rows.size, lambda name=name: np.array(rows[name]))
            for name, kind in kinds.items()
            if kind.kind in "fiub" and not kind.shape
        ]
    if array.dtype.kind not in "fiub":
        raise refusal(path, f"holds {shown(array.dtype)}; numbers are expected, store it as double")
    size = without_ones(array.shape)
    if len(size) == 2 and (columns := in_columns([Matrix(("data",), size, lambda: array.reshape(size))])[0]):
        return [replace(one, values=lambda one=one: np.array(one.values())) for one in columns]
    shape = "×".join(map(str, array.shape)) or "a single value"
    raise refusal(path, f"is {shape}; a structured array, or a matrix with a column for each signal is expected")


NPY = log_format(opened, "NumPy array", ".npy")

FORMAT = NPZ, NPY

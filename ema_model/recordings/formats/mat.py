"""MATLAB files, of version 5 to 7.3."""

from __future__ import annotations

import math
import os
import re
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ema_model.files.opened import ARRAYS, megabytes, refusal, shown
from ema_model.quantities import SIGNALS
from ema_model.recordings.formats import hdf5
from ema_model.recordings.formats.channels import (
    Channel,
    Log,
    column_names_of,
    offered,
    times_of,
    told,
    way_of_time,
    with_unit,
    without_ones,
)
from ema_model.recordings.formats.format import Array, Columns, Format
from ema_model.recordings.formats.npz import Kind, column_names, is_column, put_together, take, together

# --- MATLAB's structs that name their data in a field beside it, as Simulink's and dSPACE's do ------------------------
# Simulink's "Structure with time" has time, and for each signal `signals(i).values` and `.label` (MathWorks, To
# Workspace); ControlDesk exports `X(j).Data`, the times of each raster, and `Y(i).Data` with `.Name`, `.Unit`,
# `.Raster`.

_DATA = ("data", "values")
_NAMES, _UNITS, _RASTER = ("name", "label"), ("unit", "units"), "raster"
_TIME = re.compile(r"X(\(\d+\))?")
_TIMED = re.compile(r"Y(\(\d+\))?")


def with_names(leaves: Sequence[Leaf]) -> list[Leaf]:
    """The arrays, the data of such structs under their names; the texts that gave these are left out."""
    texts: dict[tuple[str, ...], dict[str, str]] = {}
    for leaf in leaves:
        if leaf.text:
            texts.setdefault(leaf.path[:-1], {})[leaf.path[-1].lower()] = leaf.text
    signals = {leaf.path[:-2] for leaf in leaves if len(leaf.path) > 2 and _TIMED.fullmatch(leaf.path[-2])}
    found, told = [], set()
    for leaf in leaves:
        *above, group, field = leaf.path if len(leaf.path) > 1 else ("", *leaf.path)
        here = texts.get(leaf.path[:-1], {})
        if field.lower() not in _DATA or leaf.other or not above:
            found.append(leaf)
            continue
        is_time = tuple(above) in signals and _TIME.fullmatch(group)
        name = next((here[key] for key in _NAMES if key in here), "time" if is_time else "")
        if not name:
            found.append(leaf)
            continue
        told.add(leaf.path[:-1])
        unit = next((here[key] for key in _UNITS if key in here), "s" if is_time else "")
        raster = [here[_RASTER]] if _RASTER in here else []
        # A raster's times stand above its signals, which are so known to be of them.
        own = [] if is_time and (raster or group == "X") else [group]
        found.append(replace(leaf, path=(*above, *raster, *own, with_unit(name, unit))))
    naming = (*_NAMES, *_UNITS, _RASTER)
    return [one for one in found if not (one.text and one.path[:-1] in told and one.path[-1].lower() in naming)]


# --- the layout of MATLAB's files of version 5 to 7 -------------------------------------------------------------------
# The layout of MATLAB's files of version 5 to 7: elements with a tag, packed or not, arrays within structs.
#
# A reader of our own, since files come by upload here, and scipy's ends the whole process with a segmentation fault
# on about one in a hundred files of which three bytes are changed.

HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
# How the elements' numbers are stored, and what MATLAB calls the array's class.
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_NUMERIC = range(6, 16)
_OTHERS = {1: "cells", 3: "an object", 4: "text", 5: "a sparse matrix", 16: "a function", 17: "an object"}
_CELLS, _STRUCT, _OBJECT, _TEXT, _OPAQUE = 1, 2, 3, 4, 17
_CODECS = {2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}  # of characters, by how they are stored
_LONGEST_TEXT = 1_000
_COMPLEX = 0x0800
_DEEPEST = 8  # structs within structs
_MOST_STRUCTS = 1_000  # in one array of structs, and cells
_MOST_DIMENSIONS = 32
_LONGEST_NAME = 1_000  # MATLAB's have up to 63 characters
_CHUNK = 1 << 20
_NO_DATA = memoryview(b"")


class Damaged(Exception):
    """The file breaks the layout; the text says how, for a person."""


class TooLarge(Exception):
    """The file unpacks to more than it may."""


class TooMany(Exception):
    """The file holds more arrays than it may."""


@dataclass(frozen=True)
class Leaf:
    """One array: its path of struct fields, its shape, its numbers or, if short, text, or in `other` what it is."""

    path: tuple[str, ...]
    shape: tuple[int, ...]
    data: memoryview = _NO_DATA
    dtype: str = "f8"
    other: str = ""
    text: str = ""
    first: int = 0  # of the data's numbers it takes this one
    step: int = 1  # and each so many after it

    def values(self) -> NDArray[np.float64]:
        """The numbers in MATLAB's order, column by column; (n,)."""
        return np.frombuffer(self.data, self.dtype)[self.first :: self.step].astype(np.float64, copy=False)


def leaves(file: BinaryIO, max_bytes: int) -> Iterator[Leaf]:
    """Every array in the file, structs opened.

    Raises Damaged, TooMany, and TooLarge where packed elements unpack to more than `max_bytes` in all: equal values
    pack a thousandfold, so that a small file could fill the memory.
    """
    found = 0
    for data, order in _elements(file, max_bytes):
        for leaf in _matrix(data, order, (), 0):
            found += 1
            if found > ARRAYS:
                raise TooMany
            yield leaf


def _elements(file: BinaryIO, max_bytes: int) -> Iterator[tuple[memoryview, str]]:
    """The contents of the file's arrays, unpacked, and the order of their bytes."""
    length = file.seek(0, os.SEEK_END)
    file.seek(0)
    order = "<" if file.read(HEADER_BYTES).endswith(b"IM") else ">"
    count = 0
    while tag := file.read(8):
        count += 1
        if count > ARRAYS:
            raise TooMany
        if len(tag) < 8:
            raise Damaged("it is cut short")
        kind, size = struct.unpack(f"{order}II", tag)
        if size > length - file.tell():  # asked first, since reading makes room for all of it
            raise Damaged("it is cut short")
        if kind == _COMPRESSED:
            unpacked = _unpacked(file, size, max_bytes)
            max_bytes -= len(unpacked)
            kind, data, _ = _element(unpacked, order)
        else:
            data = memoryview(file.read(size))
        if kind == _MATRIX:
            yield data, order


def _unpacked(file: BinaryIO, size: int, limit: int) -> memoryview:
    """An element of `size` packed bytes, unpacked."""
    end = file.tell() + size
    unpacker, unpacked = zlib.decompressobj(), bytearray()
    while not unpacker.eof and (packed := file.read(min(end - file.tell(), _CHUNK))):
        while packed:
            try:
                unpacked += unpacker.decompress(packed, _CHUNK)
            except zlib.error:
                raise Damaged("a packed element does not unpack") from None
            packed = unpacker.unconsumed_tail
            if len(unpacked) > limit:
                raise TooLarge
    file.seek(end)
    return memoryview(unpacked).toreadonly()


def _element(view: memoryview, order: str) -> tuple[int, memoryview, memoryview]:
    """Type and contents of the first element, and what follows it."""
    if len(view) < 8:
        raise Damaged("an element is cut short")
    (first,) = struct.unpack_from(f"{order}I", view)
    if first >> 16:  # a small one: up to four bytes in its tag
        kind, size = first & 0xFFFF, first >> 16
        if size > 4:
            raise Damaged("an element has an impossible size")
        return kind, view[4 : 4 + size], view[8:]
    (size,) = struct.unpack_from(f"{order}I", view, 4)
    if size > len(view) - 8:
        raise Damaged("an element is longer than its surroundings")
    return first, view[8 : 8 + size], view[8 + size + (-size % 8) :]


def _matrix(view: memoryview, order: str, above: tuple[str, ...], depth: int, field: str = "") -> Iterator[Leaf]:
    """The leaves of an array's contents; a field has no name of its own."""
    if not len(view):
        yield Leaf((*above, field), (0, 0))  # an empty one may be left out altogether
        return
    _, flags, view = _element(view, order)
    if len(flags) < 4:
        raise Damaged("an array has no class")
    (flag,) = struct.unpack_from(f"{order}I", flags)
    kind = flag & 0xFF
    if kind == _OPAQUE:  # it has no shape
        _, name, _ = _element(view, order)
        yield Leaf((*above, field or _text(name)), (), other=_OTHERS[kind])
        return
    stored, raw, view = _element(view, order)
    if stored != 5 or not len(raw) or len(raw) % 4 or len(raw) > 4 * _MOST_DIMENSIONS:
        raise Damaged("an array has no shape")
    shape = struct.unpack(f"{order}{len(raw) // 4}i", raw)
    if min(shape) < 0:
        raise Damaged("an array has a negative size")
    _, name, view = _element(view, order)
    path = (*above, field or _text(name))
    if kind in _NUMERIC:
        yield _numbers(view, order, path, shape, bool(flag & _COMPLEX))
    elif kind == _TEXT:
        yield Leaf(path, shape, other=_OTHERS[kind], text=_characters(view, order, shape))
    elif kind in (_STRUCT, _OBJECT) and depth < _DEEPEST and _may_open(shape, path[-1]):
        if kind == _OBJECT:
            _, _, view = _element(view, order)  # its class
        yield from _fields(view, order, path, depth, math.prod(shape))
    elif kind == _CELLS and depth < _DEEPEST and _may_open(shape, path[-1]) and path[-1] not in SIGNALS:
        yield from _cells(view, order, path, depth, math.prod(shape))
    else:
        yield Leaf(path, shape, other="structs" if kind == _STRUCT else _OTHERS.get(kind, "of an unknown class"))


def _numbers(view: memoryview, order: str, path: tuple[str, ...], shape: tuple[int, ...], is_complex: bool) -> Leaf:
    if is_complex:
        return Leaf(path, shape, other="complex numbers")
    stored, data, _ = _element(view, order)
    if stored not in _STORED:
        raise Damaged("numbers are stored in an unknown way")
    dtype = order + _STORED[stored]
    if len(data) != math.prod(shape) * np.dtype(dtype).itemsize:
        raise Damaged("an array holds more or fewer numbers than its shape says")
    return Leaf(path, shape, data, dtype)


def _characters(view: memoryview, order: str, shape: tuple[int, ...]) -> str:
    """A row of characters; nothing of a long or a wide text, which names nothing."""
    if len(shape) != 2 or shape[0] != 1 or shape[1] > _LONGEST_TEXT:
        return ""
    stored, data, _ = _element(view, order)
    codec = _CODECS.get(stored, "")
    endian = {"<": "-le", ">": "-be"}[order] if codec == "utf-16" else ""
    return bytes(data).decode(codec + endian, "replace").strip("\0 ") if codec else ""


def _may_open(shape: tuple[int, ...], name: str) -> bool:
    """Whether what is inside is offered; under a signal's own name one thing is expected, not several."""
    count = math.prod(shape)
    return count == 1 or (0 < count <= _MOST_STRUCTS and name not in SIGNALS)


def _cells(view: memoryview, order: str, path: tuple[str, ...], depth: int, count: int) -> Iterator[Leaf]:
    """What the cells hold, as MATLAB names them: log{2}."""
    for i in range(count):
        kind, data, view = _element(view, order)
        if kind != _MATRIX:
            raise Damaged("a cell holds no array")
        yield from _matrix(data, order, path[:-1], depth + 1, f"{path[-1]}{{{i + 1}}}")


def _fields(view: memoryview, order: str, path: tuple[str, ...], depth: int, count: int) -> Iterator[Leaf]:
    """The fields of one struct, or of several in a row: log(2).speed."""
    _, raw, view = _element(view, order)
    width = struct.unpack(f"{order}i", raw)[0] if len(raw) == 4 else 0
    _, names, view = _element(view, order)
    if width <= 0 or len(names) % width:
        raise Damaged("a struct's fields have no names")
    if not len(names):
        yield Leaf(path, (1, 1), other="structs")  # counted like any other
    for i in range(count):
        here = path if count == 1 else (*path[:-1], f"{path[-1]}({i + 1})")
        for start in range(0, len(names), width):
            kind, data, view = _element(view, order)
            if kind != _MATRIX:
                raise Damaged("a struct's field is no array")
            yield from _matrix(data, order, here, depth + 1, _text(names[start : start + width]))


def _text(name: memoryview) -> str:
    if len(name) > _LONGEST_NAME:
        raise Damaged("a name is too long")
    return bytes(name).split(b"\0")[0].decode("utf-8", "replace")


# --- MATLAB's .mat, version 5 to 7 ------------------------------------------------------------------------------------
# MATLAB's .mat, version 5 to 7: a vector per signal, or the columns of a matrix, alone or in structs and cells.


def _header(path: str, max_bytes: int) -> list[str]:
    if _is_hdf5(path):
        return hdf5.FORMAT.header(path, max_bytes)
    arrays = _load(path, max_bytes)
    log = _put_together(arrays)
    return list(offered(path, log)) if log else column_names(path, _kinds(arrays))


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    if _is_hdf5(path):
        return hdf5.FORMAT.read(path, names, max_bytes, strict)
    arrays = _load(path, max_bytes)
    numbers = {name: float(leaf.values()[0]) for name, leaf in arrays.items() if _is_number(leaf)}
    if log := _put_together(arrays):
        columns = together(path, log, names, max_bytes, strict)
        return replace(columns, notes=(*_told(numbers), *columns.notes))
    kinds = {name: kind for name, kind in _kinds(arrays).items() if name not in numbers or name in names}
    columns = take(path, kinds, names, max_bytes, strict, lambda name: arrays.pop(name).values())
    return replace(columns, notes=(*_told(numbers), *columns.notes))


def _told(numbers: Mapping[str, float]) -> tuple[str, ...]:
    return (f"single numbers in the file: {told(dict(numbers))}",) if numbers else ()


def _put_together(arrays: Mapping[str, Leaf]) -> Log | None:
    """The columns as channels, where they have several clocks or are several runs."""
    kinds = _kinds(arrays)
    channels = [
        Channel(leaf.path, math.prod(leaf.shape), leaf.values)
        for name, leaf in arrays.items()
        if is_column(kinds[name])
    ]
    return put_together(channels, [n for n, leaf in arrays.items() if not is_column(kinds[n]) and not _is_number(leaf)])


def _write(signals: Mapping[str, Array], path: str) -> None:
    with open(path, "wb") as file:
        from scipy.io import savemat  # reading does without it

        savemat(file, dict(signals), oned_as="column", long_field_names=True)


def _is_number(leaf: Leaf) -> bool:
    return not leaf.other and math.prod(leaf.shape) == 1


def _columns(leaf: Leaf, times: Collection[int]) -> list[Leaf]:
    """A matrix that holds signals as these; anything else as it is.  times: the lengths that time has in the file."""
    size = without_ones(leaf.shape)
    way = None if leaf.other or leaf.path[-1] in SIGNALS else way_of_time(size, times)
    if way is None:
        return [leaf]
    rows, count = size[0], size[1 - way]
    column = rows * np.dtype(leaf.dtype).itemsize
    return [
        Leaf((*leaf.path[:-1], name), (rows, 1), leaf.data[i * column : (i + 1) * column], leaf.dtype)
        if way == 0
        else Leaf((*leaf.path[:-1], name), (size[1], 1), leaf.data, leaf.dtype, first=i, step=rows)
        for i, name in enumerate(column_names_of(leaf.path[-1], count))
    ]


def _times(found: Sequence[Leaf]) -> set[int]:
    vectors = (leaf for leaf in found if not leaf.other and len(without_ones(leaf.shape)) == 1)
    return times_of((leaf.path[-1], math.prod(leaf.shape)) for leaf in vectors)


def _kinds(arrays: Mapping[str, Leaf]) -> dict[str, Kind]:
    other = {"text": np.dtype(str), "complex numbers": np.dtype(complex)}
    return {
        name: (leaf.shape, other.get(leaf.other, np.dtype(object)) if leaf.other else np.dtype(leaf.dtype))
        for name, leaf in arrays.items()
    }


def _load(path: str, max_bytes: int) -> dict[str, Leaf]:
    """All arrays, under their own names, or under "struct.field" where a name stands twice.

    Raises InputError for a file of another version, a damaged or too large one.
    """
    with open(path, "rb") as file:
        _check_version(path, file.read(HEADER_BYTES))
        try:
            found = [leaf for leaf in leaves(file, max_bytes) if leaf.path[-1]]
        except Damaged as error:
            raise refusal(path, f"is not a whole .mat file ({error}); save it again") from None
        except TooLarge:
            raise refusal(path, f"unpacks to over {megabytes(max_bytes)}, which is the limit; split it") from None
        except TooMany:
            raise refusal(path, f"holds over {ARRAYS} arrays, which is the limit; save the columns alone") from None
    found = with_names(found)
    times = _times(found)
    found = [one for leaf in found for one in _columns(leaf, times)]
    twice = [path for path, count in Counter(leaf.path for leaf in found).items() if count > 1]
    if twice:
        raise refusal(path, f"array {shown('.'.join(twice[0]))!r} stands twice; save it again with one of each name")
    count = Counter(leaf.path[-1] for leaf in found)
    return {leaf.path[-1] if count[leaf.path[-1]] == 1 else ".".join(leaf.path): leaf for leaf in found}


def _is_hdf5(path: str) -> bool:
    """Whether it is of version 7.3, which is HDF5 behind a header of MATLAB's."""
    with open(path, "rb") as file:
        header = file.read(HEADER_BYTES)
    return header[124:128] == b"\0\2IM" or header.startswith(b"\x89HDF")


def _check_version(path: str, header: bytes) -> None:
    if header[124:128] not in (b"\0\1IM", b"\1\0MI"):
        raise refusal(path, "is not a MATLAB file of version 5 to 7.3; save it with -v7")


FORMAT = Format(".mat", "MATLAB", _header, _read, _write)

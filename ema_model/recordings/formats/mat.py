"""MATLAB's .mat, version 5 to 7: a vector per signal, or the columns of a matrix, alone or in structs and cells."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ema_model.files.limits import ARRAYS, megabytes
from ema_model.files.refusal import listed, refusal, shown
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.formats import common_clock, hdf5
from ema_model.recordings.formats.arrays import Kind, check_lengths, column_names, is_column, take
from ema_model.recordings.formats.channels import Channel, Log, is_table, told
from ema_model.recordings.formats.format import Array, Columns, Format
from ema_model.recordings.formats.mat5 import HEADER_BYTES, Damaged, Leaf, TooLarge, TooMany, leaves
from ema_model.recordings.formats.mat_named import with_names
from ema_model.recordings.formats.own_clocks import with_own_clocks
from ema_model.recordings.formats.run_groups import with_runs


def _header(path: str, max_bytes: int) -> list[str]:
    if _is_hdf5(path):
        return hdf5.FORMAT.header(path, max_bytes)
    arrays = _load(path, max_bytes)
    log = _put_together(arrays)
    return list(common_clock.offered(path, log)) if log else column_names(_kinds(arrays))


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    if _is_hdf5(path):
        return hdf5.FORMAT.read(path, names, max_bytes, strict)
    arrays = _load(path, max_bytes)
    numbers = {name: float(leaf.values()[0]) for name, leaf in arrays.items() if _is_number(leaf)}
    if log := _put_together(arrays):
        columns = _together(path, log, names, max_bytes, strict)
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
    aside = [name for name, leaf in arrays.items() if not is_column(kinds[name]) and not _is_number(leaf)]
    log = Log(channels, left_aside=tuple(aside))
    found = with_own_clocks(with_runs(log))
    return None if found is log else found


def _together(path: str, log: Log, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    arrays, notes, clocks = common_clock.taken(path, log, names, max_bytes, strict)
    if strict:
        check_lengths(path, arrays)
    aside = [f"left aside, as they are no columns of numbers: {listed(log.left_aside)}"] if log.left_aside else []
    return Columns(arrays, lambda row: f"sample {row + 1}", (*aside, *log.notes, *notes), clocks=clocks)


def _write(signals: Mapping[str, Array], path: str) -> None:
    with open(path, "wb") as file:
        from scipy.io import savemat  # reading does without it

        savemat(file, dict(signals), oned_as="column", long_field_names=True)


def _is_number(leaf: Leaf) -> bool:
    return not leaf.other and math.prod(leaf.shape) == 1


def _columns(leaf: Leaf) -> list[Leaf]:
    """A matrix of a few long columns as these; anything else as it is."""
    if leaf.other or leaf.path[-1] in SIGNALS or not is_table(leaf.shape):
        return [leaf]
    rows, count = leaf.shape
    size = rows * np.dtype(leaf.dtype).itemsize
    names = [f"{leaf.path[-1]}(:,{i + 1})" for i in range(count)]
    return [
        Leaf((*leaf.path[:-1], name), (rows, 1), leaf.data[i * size : (i + 1) * size], leaf.dtype)
        for i, name in enumerate(names)
    ]


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
    found = [one for leaf in with_names(found) for one in _columns(leaf)]
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

"""HDF5, and MATLAB's version 7.3 with it: each dataset of one dimension is a column, of two a table, in any group."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ema_model.files.limits import ARRAYS
from ema_model.recordings.formats.channels import Channel, Log, NoLog, is_table, table
from ema_model.recordings.formats.logs import log_format

_DEEPEST = 8
_UNIT = ("units", "unit", "Unit", "Units", "UNIT")
_NAMES = ("columns", "column_names", "names", "labels", "channels")
_MATLAB = "MATLAB_class"
_TEXT = ("char", "string", "cell", "function_handle")


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's datasets; NoLog for what the library cannot open."""
    import h5py

    try:
        file = h5py.File(path, "r", locking=False)
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise NoLog(str(error).split("(")[0].strip() or "it does not open") from None
    with file:
        yield _log(file, most_bytes)


def _log(file: Any, most_bytes: int) -> Log:
    import h5py

    channels: list[Channel] = []
    parameters: dict[str, float] = {}
    aside: list[str] = []
    seen = 0

    def walk(group: Any, path: tuple[str, ...]) -> None:
        nonlocal seen
        for name in group:
            seen += 1
            if seen > ARRAYS:
                raise NoLog(f"it holds over {ARRAYS} datasets")
            if name.startswith("#"):  # MATLAB's own
                continue
            try:
                item = group.get(name)
            except (OSError, RuntimeError, KeyError, ValueError) as error:
                raise NoLog(f"{name[:40]!r}: {str(error).split('(')[0].strip()}") from None
            here = (*path, name)
            if isinstance(item, h5py.Group) and len(here) < _DEEPEST:
                walk(item, here)
            elif isinstance(item, h5py.Dataset):
                found = _channels(item, here, most_bytes)
                if isinstance(found, (int, float)):
                    parameters[".".join(here)] = found
                elif found:
                    channels.extend(found)
                else:
                    aside.append(".".join(here))

    walk(file, ())
    for name in list(file.attrs)[:ARRAYS]:
        value = _attribute(file, name)
        if isinstance(value, (int, float, np.number)) and np.isfinite(float(value)):
            parameters[name] = float(value)
    return Log(channels, parameters=parameters, left_aside=tuple(aside))


def _channels(item: Any, path: tuple[str, ...], most_bytes: int) -> list[Channel] | float:
    """A dataset's columns, or its single number; nothing for what holds neither."""
    shape: tuple[int, ...] = tuple(item.shape or ())
    dtype = item.dtype
    matlab = _text(_attribute(item, _MATLAB))
    if matlab in _TEXT or item.size is None or "MATLAB_empty" in item.attrs:
        return []
    unit = next((text for name in _UNIT if (text := _text(_attribute(item, name)))), "")
    if dtype.names and len(shape) == 1:
        fields = [name for name in dtype.names if dtype[name].kind in "fiub" and not dtype[name].shape]
        return [Channel((*path, name), shape[0], lambda name=name: _read(item, most_bytes)[name]) for name in fields]
    if dtype.kind not in "fiub":
        return []
    if item.size == 1:
        return float(np.asarray(_read(item, most_bytes)).reshape(-1)[0])
    if sum(size != 1 for size in shape) == 1:
        return [Channel(path, item.size, lambda: _read(item, most_bytes).reshape(-1), unit)]
    turned = matlab != ""  # MATLAB stores column by column
    if len(shape) == 2 and is_table(shape[::-1] if turned else shape):
        names = next((text for name in _NAMES if (text := _texts(_attribute(item, name)))), [])
        count, rows = shape if turned else shape[::-1]
        whole: list[Any] = []

        def column(i: int) -> Any:
            if not whole:  # read at once, since a column alone lies in every chunk
                whole.append(_read(item, most_bytes))
            return whole[0][i] if turned else whole[0][:, i]

        units = next((text for name in _UNIT if len(text := _texts(_attribute(item, name))) > 1), [unit] * count)
        return table(path, rows, count, column, names, units)
    return []


def _read(item: Any, most_bytes: int) -> Any:
    if item.size * item.dtype.itemsize > most_bytes:
        raise NoLog(f"{item.name[:40]!r} is larger than a measurement may be")
    try:
        return item[()]
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        raise NoLog(f"{item.name[:40]!r}: {str(error).split('(')[0].strip()}") from None


def _attribute(item: Any, name: str) -> Any:
    try:
        return item.attrs.get(name)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, UnicodeError):
        return None


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def _texts(value: Any) -> list[str]:
    if isinstance(value, (np.ndarray, list, tuple)):
        return [_text(one) for one in np.asarray(value, object).reshape(-1)]
    text = _text(value)
    return [part.strip() for part in text.split(",")] if "," in text else []


FORMAT = log_format(__name__, "HDF5", ".h5", ".hdf5", ".hdf", ".he5", needs="h5py")

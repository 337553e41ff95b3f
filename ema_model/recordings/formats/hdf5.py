"""HDF5, and MATLAB's version 7.3 with it: each dataset of one dimension is a column, of two several, in any group.

The format lets a file name others, from which its library would read: external links, external storage and virtual
datasets.  A file that does so is refused, since whoever wrote it would choose which files of this machine are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ema_model.errors import InputError
from ema_model.files.opened import ARRAYS, listed, refusal, shown
from ema_model.recordings.formats.channels import Channel, Log, Matrix, NoLog, in_columns, log_format, without_ones

_DEEPEST = 8
_UNIT = ("units", "unit", "Unit", "Units", "UNIT")
_NAMES = ("columns", "column_names", "names", "labels", "channels")
_MATLAB = "MATLAB_class"
_TEXT = ("char", "string", "cell", "function_handle")
_HARD, _EXTERNAL = 0, 64  # kinds of links (HDF5 specification, "Link Message")
_SAME_FILE = "."  # as a virtual dataset names its own
_FAILURES = (OSError, RuntimeError, KeyError, ValueError)


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's datasets; NoLog for what the library cannot open."""
    import h5py

    try:
        file = h5py.File(path, "r", locking=False)
    except _FAILURES as error:
        raise NoLog(_reason(error) or "it does not open") from None
    with file:
        _check_links(path, file)
        yield _log(path, file, most_bytes)


def _check_links(path: str, file: Any) -> None:
    """Raises InputError for a link to another file.  Soft links lead along these, so that none leads out either."""
    try:  # what the function returns ends the visit
        name = file.id.links.visit(lambda name, link: name if link.type == _EXTERNAL else None, info=True)
        target = "" if name is None else _text(file.id.links.get_val(name)[0])
    except _FAILURES as error:
        raise NoLog(_reason(error)) from None
    if name is not None:
        raise _elsewhere(path, f"link {shown(_text(name))!r}", target)


def _check_storage(path: str, item: Any) -> bool:
    """Raises InputError for a dataset whose numbers stand in another file; whether others of its own file hold them."""
    try:
        target, is_virtual = _stored_in(item), item.is_virtual
    except _FAILURES as error:
        raise NoLog(f"{shown(item.name)!r}: {_reason(error)}") from None
    if target:
        raise _elsewhere(path, f"dataset {shown(item.name)!r}", target)
    return is_virtual


def _check_all_storage(path: str, file: Any) -> None:
    """Raises InputError for any dataset whose numbers stand in another file."""
    import h5py

    try:  # what the function returns ends the visit
        found = file.visititems(lambda _, one: one if isinstance(one, h5py.Dataset) and _stored_in(one) else None)
    except _FAILURES as error:
        raise NoLog(_reason(error)) from None
    if found is not None:
        _check_storage(path, found)


def _stored_in(item: Any) -> str:
    """The other file that a dataset's numbers stand in; "" where they stand in its own."""
    if item.external:
        return str(item.external[0][0]) or "?"
    sources = item.virtual_sources() if item.is_virtual else ()
    return next((source.file_name or "?" for source in sources if source.file_name != _SAME_FILE), "")


def _elsewhere(path: str, what: str, target: str) -> InputError:
    leads = f"{what} leads to another file, {shown(target, 300)!r}, which is not read"
    return refusal(path, f"{leads}; save the numbers in this file itself")


def _log(path: str, file: Any, most_bytes: int) -> Log:
    import h5py

    channels: list[Channel | Matrix] = []
    parameters: dict[str, float] = {}
    aside: list[str] = []
    unresolved: list[str] = []
    seen = 0
    is_searched = False

    def walk(group: Any, above: tuple[str, ...], entered: tuple[Any, ...]) -> None:
        nonlocal seen, is_searched
        for name in group:
            seen += 1
            if seen > ARRAYS:
                raise NoLog(f"it holds over {ARRAYS} datasets")
            if name.startswith("#"):  # MATLAB's own
                continue
            here = (*above, name)
            item = _item(group, name)
            if isinstance(item, h5py.Dataset):
                if _check_storage(path, item) and not is_searched:
                    _check_all_storage(path, file)  # of which a virtual dataset may be made
                    is_searched = True
                found = _channels(item, here, most_bytes)
                if isinstance(found, (int, float)):
                    parameters[".".join(here)] = found
                elif found:
                    channels.extend(found)
                else:
                    aside.append(".".join(here))
            elif isinstance(item, h5py.Group):
                if item in entered:
                    unresolved.append(".".join(here))
                elif len(here) < _DEEPEST:
                    walk(item, here, (*entered, item))
            elif item is None:
                unresolved.append(".".join(here))

    walk(file["/"], (), (file["/"],))
    for name in list(file.attrs)[:ARRAYS]:
        value = _attribute(file, name)
        if isinstance(value, (int, float, np.number)) and np.isfinite(float(value)):
            parameters[name] = float(value)
    notes = (f"links that lead nowhere, or in a circle, are left out: {listed(unresolved)}",) if unresolved else ()
    columns, images = in_columns(channels)
    return Log(columns, parameters=parameters, notes=notes, left_aside=(*aside, *images))


def _item(group: Any, name: str) -> Any:
    """What a link leads to; None for one by name that leads nowhere, NoLog for an object that cannot be read."""
    try:
        return group[name]
    except _FAILURES as error:
        try:
            is_by_name = group.id.links.get_info(name.encode("utf-8", "surrogateescape")).type != _HARD
        except _FAILURES:
            is_by_name = False
        if is_by_name:
            return None
        raise NoLog(f"{shown(name)!r}: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    return str(error).split("(")[0].strip()


def _channels(item: Any, path: tuple[str, ...], most_bytes: int) -> Sequence[Channel | Matrix] | float:
    """A dataset's columns, matrix or single number; nothing for what holds none of these."""
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
    if len(without_ones(shape)) == 1:
        return [Channel(path, item.size, lambda: _read(item, most_bytes).reshape(-1), unit)]
    size = without_ones(shape)
    if len(size) != 2:
        return []
    turned = matlab != ""  # MATLAB stores column by column

    def values() -> Any:
        whole = _read(item, most_bytes).reshape(size)
        return whole.T if turned else whole

    names = next((text for name in _NAMES if (text := _texts(_attribute(item, name)))), [])
    count = len(names) if len(names) in size else min(size)
    units = next((text for name in _UNIT if len(text := _texts(_attribute(item, name))) > 1), [unit] * count)
    rows, columns = size
    return [Matrix(path, (columns, rows) if turned else (rows, columns), values, names, units)]


def _read(item: Any, most_bytes: int) -> Any:
    if item.size * item.dtype.itemsize > most_bytes:
        raise NoLog(f"{item.name[:40]!r} is larger than a measurement may be")
    try:
        return item[()]
    except _FAILURES as error:
        raise NoLog(f"{item.name[:40]!r}: {_reason(error)}") from None


def _attribute(item: Any, name: str) -> Any:
    try:
        return item.attrs.get(name)
    except (*_FAILURES, TypeError, UnicodeError):
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


FORMAT = log_format(opened, "HDF5", ".h5", ".hdf5", ".hdf", ".he5", needs="h5py")

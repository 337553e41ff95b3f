"""The file formats: each other file of this folder holds one, or several, found by its `FORMAT`.

To add a format, add a file with a `FORMAT`: reading, writing and their messages find it.
"""

from __future__ import annotations

from ema_model.files.opened import refusal, shown
from ema_model.members import members
from ema_model.recordings.formats.format import Columns, Format

__all__ = ["FORMATS", "WRITTEN", "Columns", "Format", "add_format", "format_of"]

FORMATS: dict[str, Format] = {}  # by suffix; those that any program reads stand first in messages and menus
WRITTEN: dict[str, Format] = {}  # those of them that are written too


def add_format(file_format: Format) -> None:
    """Makes a format known to all that read recordings; for one that stands outside of this folder."""
    for suffix in file_format.suffixes:
        FORMATS[suffix] = file_format
    if file_format.write is not None:
        WRITTEN[file_format.suffix] = file_format


def format_of(path: str, known: dict[str, Format] = FORMATS) -> Format:
    """The format that the file's suffix names; InputError lists the formats there are."""
    dot = path.rfind(".")
    suffix = path[dot:] if dot > max(path.rfind("/"), path.rfind("\\")) else ""
    try:
        return known[suffix.lower()]
    except KeyError:
        found = f"the suffix {shown(suffix)!r} is not known" if suffix else "the name has no suffix"
        raise refusal(path, f"{found}; a measurement ends in {' or '.join(known)}") from None


def _stated() -> list[Format]:
    """What the files of this folder state: those that any program reads, what is written, the others."""
    stated = members(__name__, "FORMAT").values()
    formats = [one for some in stated for one in (some if isinstance(some, tuple) else (some,))]
    return sorted(formats, key=lambda one: (one.suffix not in (".csv", ".parquet"), one.write is None, one.suffix))


for _one in _stated():
    add_format(_one)

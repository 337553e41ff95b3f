"""The file formats: each other file of this folder is one, found by its `FORMAT`.

To add a format, add a file with a `FORMAT`: reading, writing and their messages find it.
"""

from __future__ import annotations

import importlib
import pkgutil

from ema_model.files.refusal import refusal, shown
from ema_model.recordings.formats.format import Columns, Format

__all__ = ["FORMATS", "Columns", "Format", "format_of"]

_modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
_found = [module.FORMAT for module in _modules if hasattr(module, "FORMAT")]
# Those that any program reads stand first in messages and menus.
_found.sort(key=lambda file_format: file_format.suffix not in (".csv", ".parquet"))
FORMATS: dict[str, Format] = {file_format.suffix: file_format for file_format in _found}


def format_of(path: str) -> Format:
    """The format that the file's suffix names; InputError lists the formats there are."""
    dot = path.rfind(".")
    suffix = path[dot:] if dot > max(path.rfind("/"), path.rfind("\\")) else ""
    try:
        return FORMATS[suffix.lower()]
    except KeyError:
        found = f"the suffix {shown(suffix)!r} is not known" if suffix else "the name has no suffix"
        raise refusal(path, f"{found}; a measurement ends in {' or '.join(FORMATS)}") from None

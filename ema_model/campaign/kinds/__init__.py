"""What a campaign can do: each other file of this folder is one kind of task, under its file's name.

To add one, add a file with a `KIND`: plans, tables and reports find it.
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import replace

from ema_model.campaign.kinds.kind import COMMON, HOW, Kind

__all__ = ["COMMON", "HOW", "KINDS", "Kind"]

KINDS: dict[str, Kind] = {
    module.name: replace(importlib.import_module(f"{__name__}.{module.name}").KIND, name=module.name)
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name)
    if module.name != "kind"
}

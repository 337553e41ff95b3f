"""MATLAB's structs that name their data in a field beside it, as Simulink's and dSPACE's do.

Simulink's "Structure with time" has time, and for each signal `signals(i).values` and `.label` (MathWorks, To
Workspace); ControlDesk exports `X(j).Data`, the times of each raster, and `Y(i).Data` with `.Name`, `.Unit`, `.Raster`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ema_model.recordings.formats.channels import with_unit
from ema_model.recordings.formats.mat5 import Leaf

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

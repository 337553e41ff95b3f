"""MATLAB files in the structs of Simulink and of dSPACE ControlDesk."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat


def row_of_structs(structs: list[dict[str, Any]]) -> np.ndarray:
    """A 1×n array of structs."""
    row = np.empty((1, len(structs)), dtype=[(name, object) for name in structs[0]])
    for i, one in enumerate(structs):
        row[0, i] = tuple(one.values())
    return row


def write_simulink(path: Path, time: np.ndarray, signals: Mapping[str, np.ndarray]) -> None:
    """A Scope's "Structure with time" (MathWorks, "Data Format for Exported Simulation Data")."""
    parts = [
        {"values": values[:, None], "dimensions": 1.0, "label": label, "title": "", "plotStyle": 0.0}
        for label, values in signals.items()
    ]
    scope = {"time": time[:, None], "signals": row_of_structs(parts), "blockName": "rig/Scope"}
    savemat(path, {"ScopeData": scope})


def write_dspace(path: Path, rasters: Mapping[str, tuple[np.ndarray, Mapping[str, tuple[str, np.ndarray]]]]) -> None:
    """ControlDesk's export: by raster its times, and by name a signal's unit and numbers."""
    times = [{"Raster": raster, "Data": time[None, :]} for raster, (time, _) in rasters.items()]
    signals = [
        {"Name": name, "Unit": unit, "Raster": raster, "Data": values[None, :], "Path": f"Model Root/{name}"}
        for raster, (_, own) in rasters.items()
        for name, (unit, values) in own.items()
    ]
    savemat(path, {"rec1_001": {"X": row_of_structs(times), "Y": row_of_structs(signals), "Description": "a test"}})

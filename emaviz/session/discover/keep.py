"""What stays of a discovery in the data folder: the report, the recording for Rerun, the improved model."""

from __future__ import annotations

from pathlib import Path

from ema_model.actuator import save_actuator
from ema_model.discovery.steps.snapshot import Look
from emaviz.session.data_folder import DataFolder


def keep(look: Look, folder: DataFolder, suffix: str) -> Path:
    """Writes a report (.html), a recording (.rrd) or an actuator (.toml) under a new name; returns where it is."""
    found = look.found
    where = folder.actuators if suffix == ".toml" else folder.recordings
    path = folder.fresh(where, "discover", suffix)
    configuration = {
        "fitted": ", ".join(look.reach),
        "held out": ", ".join(look.held) or "–",
        "actuator": found.actuator.name,
    }
    # Imported when wanted: rerun and the report's figures take half a second of the app's start.
    if suffix == ".html":
        from emaviz.report import write_discovery_report

        write_discovery_report(found, path, configuration)
    elif suffix == ".rrd":
        from emaviz.recording.discovery.write import write_discovery

        write_discovery(found, path, configuration)
    else:
        save_actuator(found.actuator, path)
    return path

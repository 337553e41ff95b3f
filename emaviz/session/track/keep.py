"""What stays of followed flights in the data folder: the report, and the recording for Rerun."""

from __future__ import annotations

from pathlib import Path

from ema_model.tracking.result import Tracked
from emaviz.session.data_folder import DataFolder


def keep(found: Tracked, actuator: str, folder: DataFolder, suffix: str) -> Path:
    """Writes a report (.html) or a recording (.rrd) under a new name; returns where it is."""
    path = folder.fresh(folder.recordings, "track", suffix)
    if suffix == ".html":
        from emaviz.report import write_tracking_report  # plotly takes a second to import

        write_tracking_report(found, actuator, path)
    else:
        from emaviz.recording.tracking import write_tracking  # as does rerun

        write_tracking(found, path)
    return path

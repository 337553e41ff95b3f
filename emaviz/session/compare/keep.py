"""What stays of a comparison in the data folder: the report, and the recording for Rerun."""

from __future__ import annotations

from pathlib import Path

from ema_model.comparison.result import Comparison
from emaviz.session.data_folder import DataFolder


def keep(comparison: Comparison, folder: DataFolder, suffix: str) -> Path:
    """Writes a report (.html) or a recording (.rrd) under a new name; returns where it is."""
    path = folder.fresh(folder.recordings, "compare", suffix)
    # Imported when wanted: rerun and the report's figures take half a second of the app's start.
    if suffix == ".html":
        from emaviz.report import write_report

        write_report(comparison, path)
    else:
        from emaviz.recording.comparison import write_comparison

        write_comparison(comparison, path)
    return path

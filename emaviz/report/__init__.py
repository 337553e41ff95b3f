"""Reports: what was found, as one HTML file that needs nothing beside it."""

from emaviz.report.discovery import write_discovery_report
from emaviz.report.export import write_export_report

__all__ = [
    "write_discovery_report",
    "write_export_report",
]

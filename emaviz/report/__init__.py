"""Reports: what was found, as one HTML file that needs nothing beside it."""

from emaviz.report.export import write_export_report

__all__ = ["write_export_report"]

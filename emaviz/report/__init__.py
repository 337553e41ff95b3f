"""Reports: what was found, as one HTML file that needs nothing beside it."""

from emaviz.report.comparison import write_report

__all__ = ["write_report"]

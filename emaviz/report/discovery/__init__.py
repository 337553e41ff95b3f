"""The report of a discovery, a file for each section."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ema_model.discovery import Discovery
from emaviz.report.discovery.subject import Told
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[Told], ...] = sections(__name__)


def write_discovery_report(found: Discovery, path: str | Path, configuration: Mapping[str, Any] | None = None) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written.

    configuration: the options that it was made with.
    """
    told = Told.of(found, configuration or {})
    names = ", ".join(track.name or "recording" for track in told.tracks)
    title = "The model is adequate" if found.verdict == "adequate" else "What the model lacks"
    write(path, page(title, f"{found.actuator.name} against {names}", SECTIONS, told))

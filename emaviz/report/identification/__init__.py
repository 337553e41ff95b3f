"""The report of an identification, a file for each section."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ema_model.identification.objective import Objective
from ema_model.identification.run import Identification
from ema_model.identification.words import verdict
from emaviz.report.identification.subject import Identified
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[Identified], ...] = sections(__name__)


def write_identification_report(
    answer: Identification,
    objective: Objective,
    path: str | Path,
    holdout_rmse: float | None = None,
    configuration: Mapping[str, Any] | None = None,
) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written.

    holdout_rmse: A, of the answer on recordings that were not fitted; configuration: the options.
    """
    subject = Identified(answer, objective, holdout_rmse, configuration or {})
    names = ", ".join(one.name or "a simulated run" for one in objective.measurements)
    told = verdict(answer)
    write(path, page(told[:1].upper() + told[1:], f"{objective.actuator.name} against {names}", SECTIONS, subject))

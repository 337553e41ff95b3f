"""The data health card: what a recording's own numbers say about its sampling, sensors, signs and limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, TypedDict

import numpy as np
from msgspec import Meta

from ema_model.actuator import Actuator
from ema_model.recordings.health import checks
from ema_model.recordings.health.clocks import clocks
from ema_model.recordings.health.finding import MARKS, Finding, Severity
from ema_model.recordings.measurement import Measurement
from ema_model.text import InWords

__all__ = ["Finding", "Health", "health", "health_of"]


class FindingJson(TypedDict):
    """What one check of a recording found."""

    check: Annotated[str, Meta(description="which one: sampling, noise, delay, …")]
    severity: Annotated[Severity, Meta(description="how much it matters")]
    sentence: Annotated[str, Meta(description="the finding in words, with its number and unit")]
    values: Annotated[dict[str, float | None], Meta(description="its numbers, units in the names; null: not known")]
    signal: Annotated[str | None, Meta(description="of which signal; null: of the recording")]


class HealthJson(TypedDict):
    """The data health card of a recording."""

    name: Annotated[str, Meta(description="the recording's")]
    severity: Annotated[Severity, Meta(description="the worst of all findings")]
    findings: Annotated[list[FindingJson], Meta(description="in the order of the checks")]


@dataclass(frozen=True, repr=False)
class Health(InWords):
    """All findings, in the order of the checks."""

    name: str
    findings: tuple[Finding, ...] = field(default_factory=tuple)

    @property
    def severity(self) -> Severity:
        """The worst of all findings."""
        worst = self.worst_first
        return worst[0].severity if worst else "good"

    @property
    def worst_first(self) -> list[Finding]:
        """All findings, warnings before notes."""
        rank = list(MARKS)
        return sorted(self.findings, key=lambda finding: rank.index(finding.severity))

    def of(self, check: str, signal: str | None = None) -> Finding | None:
        """The first finding of a check, such as "noise", of one signal where given."""
        fits = (f for f in self.findings if f.check == check and signal in (None, f.signal))
        return next(fits, None)

    def as_dict(self) -> HealthJson:
        """For JSON: numbers that are not known are null."""
        findings = []
        for finding in self.findings:
            entry = FindingJson(**asdict(finding))
            entry["values"] = {k: v if np.isfinite(v) else None for k, v in finding.values.items()}
            findings.append(entry)
        return {"name": self.name, "severity": self.severity, "findings": findings}


def health_of(measurement: Measurement, actuator: Actuator) -> Health:
    """The health card of a recording of this actuator."""
    limit: float | None = actuator.controller.current_limit_A
    if not np.isfinite(limit):  # a drive whose limit is not known
        limit = None
    return health(measurement, current_limit_A=limit, pole_pairs=actuator.motor.pole_pairs)


def health(
    measurement: Measurement, *, current_limit_A: float | None = None, pole_pairs: float | None = None
) -> Health:
    """The health card of a recording, by the names in files; checks whose signals are missing are left out.

    The current's limit is taken from the side file where it is not given; without one flat tops are sought.
    """
    limit = current_limit_A or measurement.side.sensors.get("current_limit_A")
    found = _findings(measurement, limit, pole_pairs)
    return Health(measurement.name, tuple(replace(f, signal=f.signal and measurement.shown(f.signal)) for f in found))


def _findings(measurement: Measurement, limit: float | None, pole_pairs: float | None) -> Iterator[Finding]:
    if not measurement.is_map:
        yield from checks.sampling(measurement)
    yield from checks.sensors(measurement)
    yield from checks.saturation(measurement, limit)
    if measurement.is_map:
        return
    yield from checks.delay(measurement)
    yield from clocks(measurement)
    yield from checks.signs(measurement)
    yield from checks.phases(measurement, pole_pairs)
    yield from checks.standstill(measurement)

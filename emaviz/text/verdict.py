"""What a verdict means, which its colour says on the page as in a report."""

from __future__ import annotations

from typing import Literal

from ema_model.comparison.result import Comparison
from ema_model.discovery.result import Discovery
from ema_model.text import COLOURS
from ema_model.units.result import UnitsCompared

Meaning = Literal["good", "found", "warning", "bad", "open"]
MEANINGS: dict[Meaning, str] = {
    "good": COLOURS["good"],  # nothing is missing
    "found": "light-dark(#1c5fc4,#74b0ff)",  # something is, and is named
    "warning": COLOURS["warning"],  # something is, of which nothing is known
    "bad": COLOURS["bad"],
    "open": "inherit",  # it is still looked at
}


def of_comparison(comparison: Comparison) -> Meaning:
    """A comparison says where the model fails, and never why."""
    return "good" if comparison.adequate else "warning"


def of_units(found: UnitsCompared) -> Meaning:
    """Units that differ call for attention, and models that miss something cannot say that none does."""
    return "warning" if found.differences or found.scattering or found.is_missed else "good"


def of_discovery(found: Discovery) -> Meaning:
    """An actuator with a fault, or with another controller or parameters than its file's, is not as it should be."""
    if found.verdict == "adequate":
        other = found.faults or found.parameters_outside_tolerance or found.controller_seen is not None
        return "found" if other else "good"
    return "found" if found.verdict == "effects_found" else "warning"

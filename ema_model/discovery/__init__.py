"""Discovery: which physical effect is missing, how sure that is, and the model with it."""

from __future__ import annotations

from ema_model.discovery.discover import discover, result_of, settings_of
from ema_model.discovery.history import Story, begun
from ema_model.discovery.remaining import Verified, verified
from ema_model.discovery.result import Added, Candidate, Discovery, Experiment, Rung

__all__ = [
    "Added",
    "Candidate",
    "Discovery",
    "Experiment",
    "Rung",
    "Story",
    "Verified",
    "begun",
    "discover",
    "result_of",
    "settings_of",
    "verified",
]

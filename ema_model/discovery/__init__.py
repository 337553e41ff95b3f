"""Discovery: which physical effect is missing, how sure that is, and the model with it."""

from __future__ import annotations

from ema_model.discovery.discover import discover, settings_of
from ema_model.discovery.result import Added, Candidate, Discovery, Rung
from ema_model.discovery.summary import as_dict

__all__ = ["Added", "Candidate", "Discovery", "Rung", "as_dict", "discover", "settings_of"]

"""Comparison: recordings beside the model, what is left, and where and why."""

from __future__ import annotations

from ema_model.comparison.compare import compare
from ema_model.comparison.explain import Explanation
from ema_model.comparison.regions import Region
from ema_model.comparison.result import Compared, Comparison, SignalError

__all__ = ["Compared", "Comparison", "Explanation", "Region", "SignalError", "compare"]

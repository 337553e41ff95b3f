"""The JSON form of what the flights of a unit tell."""

from __future__ import annotations

from typing import Any

from ema_model.tracking.result import FaultTrack, Tracked
from ema_model.tracking.words import answer


def as_dict(result: Tracked) -> dict[str, Any]:
    """Plain values only."""
    left_out = [{"flight": one.name, "reason": one.excluded} for one in result.flights if one.excluded]
    return {
        "answer": answer(result),
        "trusted": result.trusted,
        "warnings": list(result.warnings),
        "flights": [one.name for one in result.flights],
        "correlation": result.correlation.tolist(),
        "faults": {name: _fault(one) | {"excluded": left_out} for name, one in result.faults.items()},
    }


def _fault(one: FaultTrack) -> dict[str, Any]:
    left = one.remaining
    return {
        "trend": one.trend,
        "level": one.level,
        "level_interval90": list(one.level90),
        "drift": one.drift,
        "drift_interval90": list(one.drift90),
        "since": one.since or None,
        "threshold": one.threshold,
        "remaining_flights": None if left is None else {"p05": left.p05, "p50": left.p50, "p95": left.p95},
        "reason": one.reason or None,
        "crossing_probability": []
        if left is None
        else [{"flights": n, "probability": probability} for n, probability in left.crossing],
        "jumps": [
            {"flight": jump.flight, "before": jump.before, "after": jump.after, "replaced": jump.towards_healthy}
            for jump in one.jumps
        ],
        "log_evidence": one.evidence,
        "k": one.k.tolist(),
        "sigma": one.sigma.tolist(),
    }

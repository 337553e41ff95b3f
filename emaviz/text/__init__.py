"""Results in words, for the terminal, the page, reports and recordings alike."""

from __future__ import annotations

_LEAST_SHARE, _LEAST_S = 0.05, 1.0  # done, before anything can be said


def going_on(elapsed_s: float, share: float | None) -> str:
    """'4 s, about 6 s left', or the first alone where nothing is known of the rest."""
    left = "" if share is None else time_left(elapsed_s, share)
    return f"{elapsed_s:.0f} s, {left}" if left else f"{elapsed_s:.0f} s"


def time_left(elapsed_s: float, share: float) -> str:
    """'about 4 s left'; empty too early, and near the end."""
    if share < _LEAST_SHARE or elapsed_s < _LEAST_S:
        return ""
    left = elapsed_s * (1.0 - share) / share
    if left < _LEAST_S:
        return ""
    return f"about {left:.0f} s left" if left < 90.0 else f"about {left / 60.0:.0f} min left"

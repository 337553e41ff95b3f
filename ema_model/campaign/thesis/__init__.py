"""The thesis's evaluation (tables 5.1–5.43, chapter 6) from a campaign's rows: its numbers beside ours.

What it computes is the plan `thesis`; here rows are only put together, so that a change here leaves them valid.
"""

from __future__ import annotations

from ema_model.campaign.thesis.result import Evaluation

__all__ = ["Evaluation"]

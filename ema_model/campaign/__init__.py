"""Campaigns: the many tasks of a plan, computed by processes or on Dask, each kept as it comes."""

from __future__ import annotations

from ema_model.campaign.plan import Plan, load_plan, plan_path, shipped_plans
from ema_model.campaign.run import Status, duration, estimate_s, run_plan, scheduler
from ema_model.campaign.store import Store

__all__ = [
    "Plan",
    "Status",
    "Store",
    "duration",
    "estimate_s",
    "load_plan",
    "plan_path",
    "run_plan",
    "scheduler",
    "shipped_plans",
]

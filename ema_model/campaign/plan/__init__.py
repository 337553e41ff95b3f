"""A plan: a TOML file that says which tasks a campaign has, as products of axes or as lists of recordings.

    title = "Robust identification"

    [runs.chirp]                      # what simulated recordings are made with
    command = "chirp"
    duration_s = 0.5

    [groups.noisy]                    # a product: each entry is one choice, or a list of them
    does = "identify"                 # or discover, compare
    runs = ["chirp", "step"]          # two tasks; [["chirp", "step"]] is one that fits both recordings
    faults = [{ k1 = 0.25 }, { uniform = { k1 = [0, 0.5], k8 = [0.2, 0.8] } }]
    noise_A = [0.1, 0.45]
    algorithm = ["robust", "do"]      # every setting of what it does may be an axis, too
    seeds = { from = 0, count = 100 }

    [groups.bench]
    does = "discover"
    actuator = "rig.toml"
    recordings = "logs/*.csv"         # each is a task; or { fit = ["a.csv", "b.csv"], holdout = ["c.csv"] }, with
                                      # each = "unit_*" in every such folder

`like = "other.toml"` takes all of another plan first; what stands here goes before it.
"""

from __future__ import annotations

from ema_model.campaign.plan.load import Plan, load_plan, plan_path, shipped_plans

__all__ = ["Plan", "load_plan", "plan_path", "shipped_plans"]

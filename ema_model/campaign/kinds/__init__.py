"""What a campaign can do: each other file of this folder is one kind of task, under its file's name.

To add one, add a file with a `KIND`: plans, tables and reports find it.
"""

from __future__ import annotations

from dataclasses import replace

from ema_model.campaign.kinds.kind import COMMON, HOW, Kind
from ema_model.members import members

__all__ = ["COMMON", "HOW", "KINDS", "Kind"]

KINDS: dict[str, Kind] = {name: replace(kind, name=name) for name, kind in members(__name__, "KIND").items()}

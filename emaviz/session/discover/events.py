"""What the page hears of a discovery, besides its job."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ema_model.discovery.steps.snapshot import Look
from emaviz.session.signal import Signal


@dataclass
class DiscoverEvents:
    """What the screen listens to; called on the threads that work, so listeners only hand over."""

    looked: Signal[[Look | None]] = field(default_factory=Signal)  # the story has changed
    unsuggested: Signal[[]] = field(default_factory=Signal)  # no test tells the candidates apart
    revealed: Signal[[]] = field(default_factory=Signal)
    previewed: Signal[[Any]] = field(default_factory=Signal)  # `discovery_own.Preview`
    unpreviewed: Signal[[str]] = field(default_factory=Signal)  # why a torque has no preview
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report, a recording, a model
    verified: Signal[[Path, str]] = field(default_factory=Signal)  # a kept model, and how good it is

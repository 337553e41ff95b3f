"""What the sections of a discovery's report are about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ema_model.discovery import Discovery
from ema_model.discovery.shown.tracks import Track, tracks


@dataclass(frozen=True, eq=False)
class Told:
    """A discovery with its recordings as lines over time, and how it was asked for."""

    found: Discovery
    tracks: Sequence[Track]
    configuration: Mapping[str, Any]

    @classmethod
    def of(cls, found: Discovery, configuration: Mapping[str, Any]) -> Told:
        """Puts the lines together once for all sections."""
        return cls(found, tracks(found), configuration)

"""What a "Keep it" folder does when something else is shown."""

from __future__ import annotations

from typing import Protocol


class Cleared(Protocol):
    """Forgets what it has said of files that were kept of what was shown before."""

    def clear(self) -> None:
        """To be called on the screen's thread."""

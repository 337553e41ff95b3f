"""The files that come with the package."""

from __future__ import annotations

from importlib import resources
from pathlib import Path


def shipped_folder(name: str) -> Path:
    """A folder of assets: inside the installed package, or in the repository beside it."""
    inside = Path(str(resources.files("ema_model") / "assets" / name))
    return inside if inside.is_dir() else Path(__file__).parents[2] / "assets" / name

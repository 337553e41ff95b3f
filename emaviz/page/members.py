"""Finds the tabs: every file here that states a `WORKSPACE` and defines its tab, or folder whose `tab.py` does."""

from __future__ import annotations

import importlib

from ema_model.members import classes_in, members
from emaviz.page.tab import Tab


def tabs() -> list[type[Tab]]:
    """In their order."""
    found: list[type[Tab]] = []
    for name in members("emaviz.page", "WORKSPACE", files=True, folders=True):
        module = importlib.import_module(f"emaviz.page.{name}")
        if hasattr(module, "__path__"):
            module = importlib.import_module(f"emaviz.page.{name}.tab")
        found += classes_in(module, Tab)
    return sorted(found, key=lambda one: one.workspace.place)

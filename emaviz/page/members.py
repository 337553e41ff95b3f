"""Finds the tabs: every folder here that states a `WORKSPACE`, and whose `tab.py` defines its tab."""

from __future__ import annotations

import importlib

from ema_model.members import classes_in, members
from emaviz.page.tab import Tab


def tabs() -> list[type[Tab]]:
    """In their order."""
    folders = members("emaviz.page", "WORKSPACE", files=False, folders=True)
    modules = [importlib.import_module(f"emaviz.page.{name}.tab") for name in folders]
    found: list[type[Tab]] = [one for module in modules for one in classes_in(module, Tab)]
    return sorted(found, key=lambda one: one.workspace.place)

"""Finds the workspaces: every folder here that says it is one."""

from __future__ import annotations

import importlib
import pkgutil

import emaviz.page
from emaviz.page.workspaces import Workspace


def workspaces() -> list[Workspace]:
    """In the order of their tabs."""
    folders = [one.name for one in pkgutil.iter_modules(emaviz.page.__path__) if one.ispkg]
    modules = [importlib.import_module(f"emaviz.page.{name}") for name in folders]
    found = [module.WORKSPACE for module in modules if hasattr(module, "WORKSPACE")]
    return sorted(found, key=lambda one: one.place)

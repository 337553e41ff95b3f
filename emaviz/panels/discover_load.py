"""A suggested test into Explore: its command, duration and load, as if a person had set them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ema_model.commands import COMMANDS
from ema_model.discovery.result import Experiment
from emaviz.panels.explore import ExplorePanel
from emaviz.panels.page import Page


def load_into_explore(explore: ExplorePanel, page: Page, one: Experiment) -> None:
    """Sets the session and Explore's controls, and simulates; InputError where Explore does not take a value."""
    settings = page.session.settings
    for name, value in one.settings.items():
        settings.set_command_setting(one.command, name, value)
    settings.set_command(one.command)
    settings.set_duration(one.duration_s)
    settings.set_load(one.load_torque_Nm)
    names = [f.name for f in fields(COMMANDS[one.command])]
    with page.server.atomic():
        for name, entry in zip(names, explore._groups[one.command]):
            if name in one.settings:
                entry.value = one.settings[name]
        explore._command.value = COMMANDS[one.command].title
        for label, value in (("Duration [s]", one.duration_s), ("Load torque [N·m]", one.load_torque_Nm)):
            _entry(page, label).value = value
    page.session.refresh()


def _entry(page: Page, label: str) -> Any:
    """The page's control of that label."""
    return next(one for one in page.server.gui._gui_input_handle_from_uuid.values() if one.label == label)

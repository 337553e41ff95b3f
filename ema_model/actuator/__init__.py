"""Actuators: their parameters with tolerances, and the TOML files that hold them."""

from __future__ import annotations

from ema_model.actuator.actuator import Actuator
from ema_model.actuator.file import actuator_text, load_actuator, parse_actuator, save_actuator, shipped
from ema_model.actuator.parameters import Rule, Tolerance, paths

__all__ = [
    "Actuator",
    "Rule",
    "Tolerance",
    "actuator_text",
    "load_actuator",
    "parse_actuator",
    "paths",
    "save_actuator",
    "shipped",
]

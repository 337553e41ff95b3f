"""The questions of `emaviz actuator new` on a terminal: an empty answer takes the guess."""

from __future__ import annotations

import argparse
from typing import Any

from ema_model.actuator.describe import DRIVES, actuator_axes, asked, entry_of, gear_of, unanswered
from ema_model.actuator.parameters import KINDS, facts_of, on_axes
from ema_model.errors import InputError
from ema_model.quantities import KINDS as AXES
from emaviz.cli.options import SAMPLE_RATE

_GEAR = "transmission.gear_ratio"


def ask(document: dict[str, Any], arguments: argparse.Namespace) -> None:
    """Asks for the kinds and for each parameter that the options leave open; fills in document and arguments."""
    axes = document["axes"]
    for side, about in (("motor", "Does the motor turn or slide"), ("user", "Does what it moves turn or slide")):
        if getattr(arguments, side) is None:
            axes[side] = _choice(about, dict.fromkeys(AXES, ""))
    arguments.controller = _choice("Which controller", KINDS["controller"])
    drives = DRIVES[arguments.controller]
    if drives and arguments.drive not in drives:
        arguments.drive = _choice("Which drive", {name: KINDS["inverter"][name] for name in drives})
    if arguments.sample_rate is None:
        arguments.sample_rate = _sample_rate()
    print("Now the parameters: a number, with its tolerance if you know it (1e-4 ± 5%); Enter for what you don't know.")
    shown = actuator_axes(document)
    for path in asked(arguments.controller, arguments.drive if drives else "current"):
        section, name = path.partition(".")[0], on_axes(path, shown).name
        if name not in document.get(section, {}) and (entry := _number(path, shown, arguments.controller)) is not None:
            document.setdefault(section, {})[name] = entry


def _choice(question: str, choices: dict[str, str]) -> str:
    for name, meaning in choices.items():
        if meaning:
            print(f"  {name:11} {meaning}")
    first = next(iter(choices))
    while True:
        answer = input(f"{question}: {', '.join(choices)}? [{first}] ").strip() or first
        found = [name for name in choices if name.startswith(answer)]
        if len(found) == 1:
            return found[0]
        print(f"  one of {', '.join(choices)}, please")


def _sample_rate() -> float | None:
    while True:
        text = input("How many samples a second have its recordings, Hz [not known] ").strip()
        if not text:
            return None
        try:
            return SAMPLE_RATE(text)
        except argparse.ArgumentTypeError as error:
            print(f"  {error}")


def _number(path: str, axes: Any, controller: str) -> dict[str, Any] | None:
    named, facts, usual = on_axes(path, axes), facts_of(path, axes), unanswered(path, axes, controller)
    while True:
        text = input(f"{named.title}: {facts.meaning}{f', {named.unit}' if named.unit else ''} [{usual}] ").strip()
        if not text:
            return None
        try:
            return (gear_of if path == _GEAR else entry_of)(text, "not a number")
        except InputError as error:
            print(f"  {error}")

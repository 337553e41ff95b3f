"""A run as a part of a sentence."""

from __future__ import annotations

from collections.abc import Mapping

from ema_model.commands import COMMANDS
from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.sides import USER
from ema_model.quantities.titles import in_sentence, parameter_title, unit_of


def run_in_words(command: str, settings: Mapping[str, float], duration_s: float, axes: Axes = ROTARY) -> str:
    """'a sine with amplitude 0.03 rad, frequency 2 Hz, for 0.5 s'."""
    title = COMMANDS[command].title
    named = {axes.name(name, USER): value for name, value in settings.items()}
    parts = (
        f"{in_sentence(parameter_title(name))} {value:.4g} {unit_of(name)}".rstrip() for name, value in named.items()
    )
    article = "an" if title[:1] in "AEIOU" else "a"
    return f"{article} {in_sentence(title)} with {', '.join(parts) or 'its usual settings'}, for {duration_s:g} s"

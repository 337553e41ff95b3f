"""Names of settings and parameters as labels of controls, and runs as parts of sentences."""

from __future__ import annotations

from collections.abc import Mapping

from ema_model.commands import COMMANDS

_UNITS = {
    "Nm_rad": "N·m/rad",
    "Nms_rad": "N·m·s/rad",
    "rad_s": "rad/s",
    "1_rad": "1/rad",
    "mm": "mm",
    "Nm": "N·m",
    "kgm2": "kg·m²",
    "rad": "rad",
    "Hz": "Hz",
    "Ohm": "Ω",
    "us": "µs",
    "s": "s",
    "A": "A",
    "V": "V",
    "N": "N",
}


def readable(name: str) -> str:
    """`amplitude_rad` as "Amplitude [rad]"; a name without a unit is a number."""
    for ending, unit in _UNITS.items():
        if name.endswith(f"_{ending}"):
            return f"{_sentence(name.removesuffix(f'_{ending}'))} [{unit}]"
    return _sentence(name)


def run_in_words(command: str, settings: Mapping[str, float], duration_s: float) -> str:
    """'a sine with amplitude 0.03 rad, frequency 2 Hz, for 0.5 s'."""
    title = COMMANDS[command].title
    parts = []
    for name, value in settings.items():
        label, _, unit = readable(name).partition(" [")
        parts.append(f"{label.lower()} {value:.4g} {unit.rstrip(']')}".rstrip())
    article = "an" if title[:1] in "AEIOU" else "a"
    return f"{article} {title.lower()} with {', '.join(parts) or 'its usual settings'}, for {duration_s:g} s"


def _sentence(name: str) -> str:
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]

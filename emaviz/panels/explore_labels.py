"""Names of settings and parameters as labels of controls."""

from __future__ import annotations

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


def _sentence(name: str) -> str:
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]

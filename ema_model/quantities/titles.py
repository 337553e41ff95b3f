"""Names of parameters and settings in words: the title, the unit that the name ends with, a title in a sentence."""

from __future__ import annotations

_UNITS = {
    "Nms2_rad": "N·m·s²/rad",
    "Nms_rad": "N·m·s/rad",
    "Ns2_m": "N·s²/m",
    "Nm_rad": "N·m/rad",
    "Nm_A": "N·m/A",
    "Ns_m": "N·s/m",
    "kgm2": "kg·m²",
    "rad_s": "rad/s",
    "1_rad": "1/rad",
    "N_m": "N/m",
    "N_A": "N/A",
    "m_s": "m/s",
    "1_m": "1/m",
    "1_s": "1/s",
    "Ohm": "Ω",
    "rad": "rad",
    "Nm": "N·m",
    "Hz": "Hz",
    "kg": "kg",
    "N": "N",
    "m": "m",
    "H": "H",
    "V": "V",
    "A": "A",
    "s": "s",
}
_PROPER = frozenset(("Stribeck",))


def parameter_title(path: str) -> str:
    """'Motor inertia' of 'motor.inertia_kgm2', 'Amplitude' of 'amplitude_rad'."""
    section, _, name = path.rpartition(".")
    words = f"{section.replace('.', ' ')} {name.removesuffix(f'_{_ending(name)}')}".replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def unit_of(path: str) -> str:
    """'kg·m²' of 'motor.inertia_kgm2'; a name without a unit is a number.

    The starts of a recording ("play 0") are angles.
    """
    return "rad" if " " in path else _UNITS.get(_ending(path), "")


def labelled(path: str) -> str:
    """'Amplitude [rad]' of 'amplitude_rad'."""
    unit = unit_of(path)
    return f"{parameter_title(path)} [{unit}]" if unit else parameter_title(path)


def in_sentence(title: str) -> str:
    """A title within a sentence: 'motor inertia', 'phase A current', but 'RMS current' and 'Stribeck friction'."""
    if title[1:2].isupper() or title.partition(" ")[0] in _PROPER:
        return title
    return title[:1].lower() + title[1:]


def _ending(name: str) -> str:
    return next((ending for ending in _UNITS if name.endswith(f"_{ending}")), "")

"""Names of parameters and settings in words: the title, the unit that the name ends with, a title in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

from ema_model.quantities.si import of_name, without_unit

_PROPER = frozenset(("Stribeck",))
_OWNERS = {"sensors": "sensor"}  # of a section with several, of which each has its own


def parameter_title(path: str) -> str:
    """'Motor inertia' of 'motor.inertia_kgm2', 'Amplitude' of 'amplitude_rad'."""
    section, _, name = path.rpartition(".")
    words = f"{_OWNERS.get(section, section).replace('.', ' ')} {without_unit(name)}".replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def unit_of(name: str) -> str:
    """'kg·m²' of 'motor.inertia_kgm2'; a name without a unit is a number."""
    unit = of_name(name)
    return "" if unit is None else unit.shown


def labelled(name: str, unit: str | None = None) -> str:
    """'Amplitude [rad]' of 'amplitude_rad'; `unit`: where it is another than the name says."""
    unit = unit_of(name) if unit is None else unit
    return f"{parameter_title(name)} [{unit}]" if unit else parameter_title(name)


def in_sentence(title: str) -> str:
    """A title within a sentence: 'motor inertia', 'phase A current', but 'RMS current' and 'Stribeck friction'."""
    if title[1:2].isupper() or title.partition(" ")[0] in _PROPER:
        return title
    return title[:1].lower() + title[1:]


def all_of(names: Sequence[str]) -> str:
    """'a, b and c'."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"

"""German names of columns, put into the English words that guessing knows: Motordrehzahl is motor, speed."""

from __future__ import annotations

import re

_ENGLISH = {
    # what is measured
    "zeitstempel": "timestamp",
    "uhrzeit": "time",
    "zeit": "time",
    "datum": "date",
    "drehwinkel": "angle",
    "winkel": "angle",
    "lage": "position",
    "weg": "displacement",
    "hub": "stroke",
    "drehzahl": "speed",
    "winkelgeschwindigkeit": "angularvelocity",
    "geschwindigkeit": "speed",
    "strom": "current",
    "drehmoment": "torque",
    "moment": "torque",
    "kraft": "force",
    "spannung": "voltage",
    "temperatur": "temperature",
    "tastgrad": "duty",
    "freigabe": "enable",
    "abschnitt": "segment",
    "versuch": "trial",
    "position": "position",
    # whose, and whether it is wanted or measured
    "soll": "setpoint",
    "fuehrungs": "setpoint",
    "ist": "actual",
    "mess": "measured",
    "motor": "motor",
    "rotor": "rotor",
    "abtriebs": "output",
    "ausgangs": "output",
    "klappen": "flap",
    "last": "load",
    "stoer": "disturbance",
    "zwischenkreis": "bus",
    "versorgungs": "supply",
    "batterie": "battery",
    "wert": "value",
}
_PARTS = re.compile("|".join(sorted(_ENGLISH, key=len, reverse=True)))
_NOUNS = frozenset(_ENGLISH) - {"position", "motor", "rotor"}  # which English has too
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})


def without_umlauts(text: str) -> str:
    """Small letters with ä, ö, ü and ß spelt out."""
    return text.lower().translate(_UMLAUTS)


def in_english(word: str) -> list[str]:
    """The English words of one that is made up of German ones only; any other word as it is."""
    parts = _PARTS.findall(word)
    if "".join(parts) != word or _NOUNS.isdisjoint(parts):
        return [word]
    return [_ENGLISH[part] for part in parts]

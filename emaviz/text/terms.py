"""Abbreviations and terms of the field that the page uses, each explained where it stands."""

from __future__ import annotations

import re

from emaviz.text.html import Html, html, html_escape, unescaped

TERMS = {
    "Err": "Error of k in %: how far the eight k that were found are from the true ones (the thesis's equation 5.2)",
    "PC": "Performance coefficient in %: error times time, beside the other algorithms of the same race; higher is "
    "better (the thesis's equation 5.4)",
    "uncorrected error": "rms of measured less model current as it is drawn; what the simplified model is known to "
    "lack counts as error here",
    "corrected error": "rms of measured less model current, with what the simplified model is known to lack added",
    "equivalent current": "The one current that makes the motor's torque as its three phase currents do together "
    "(the thesis's equation 3.14)",
    "times the floor": "The floor is what a true model would still leave: the sensors' noise, and what the model "
    "leaves out on purpose. At 1 nothing is missing",
    "× floor": "Error over the floor, which is what a true model would still leave: 1 means that nothing is missing",
    "cross-validated": "Fitted to parts of the recordings and judged on the others, so that chance explains nothing",
    "rms": "Root mean square: the usual size of an error, sign and moment aside",
    "mean |e|": "Mean size of the error, whatever its sign",
    "of range": "The rms error in % of what the signal goes through, from its least to its largest value",
    "σ": "Standard deviations: of a parameter, those of its tolerance in the actuator's file",
    "90 % interval": "Nine of ten such intervals hold the true value",
}
_EVERY = re.compile("|".join(rf"(?<![\w-]){re.escape(one)}(?![\w-])" for one in sorted(TERMS, key=len, reverse=True)))
_TAG = re.compile(r"(<[^>]*>)")


def explained(content: str) -> Html:
    """Text or HTML, each term underlined where it stands first, and explained to the pointer."""
    told: set[str] = set()

    def explain(found: re.Match[str]) -> str:
        term = found.group()
        if term in told:
            return term
        told.add(term)
        return str(html('<abbr title="{}">{}</abbr>', TERMS[term], term))

    parts, quiet = [], 0  # within what has a hint of its own, or is no text
    for part in _TAG.split(str(html_escape(content))):
        if part.startswith("<"):
            name = re.match(r"</?(\w*)", part)
            if name is not None and name.group(1) in ("abbr", "style", "svg", "math", "summary"):
                quiet += -1 if part.startswith("</") else 1
            parts.append(part)
        else:
            parts.append(part if quiet else _EVERY.sub(explain, part))
    return unescaped("".join(parts))

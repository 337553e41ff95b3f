"""With what the report was made, so that it can be made again."""

from __future__ import annotations

import numba
import numpy as np

from emaviz import __version__
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import paragraph, table
from emaviz.report.section import Figures, Section

_METHOD = (
    "The model is calibrated within its tolerances. Every effect of the library is given a fingerprint: what it would "
    "change in the signals. The promising ones are fitted together with all parameters, and the best is added when "
    "the data pay for its parameters (BIC), on most stretches of time, by 1 % of the error or more, and on the "
    "recordings that were held out. That repeats until nothing more pays."
)


class HowMade(Section[Told]):
    """The method in short, versions and options."""

    title = "How it was made"
    anchor = "made"
    place = 100

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        given = {name: value for name, value in subject.configuration.items() if value not in (None, [], "")}
        told = {
            "actuator": subject.found.actuator.name,
            **{name: ", ".join(map(str, v)) if isinstance(v, list) else v for name, v in given.items()},
            "emaviz": __version__,
            "numpy": np.__version__,
            "numba": numba.__version__,
        }
        rows = [[name.replace("_", " "), value] for name, value in told.items()]
        return paragraph(_METHOD) + table(["Setting", "value"], rows, text_columns=2)

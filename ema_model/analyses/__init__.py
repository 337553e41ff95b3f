"""Analyses of recordings beside the model.  A new one is four files, and its verb, JSON, report and recording follow.

Each file here that states an `OPTIONS` is one: its engine.  What it says stands in the file of its name with `_words`,
how it is shown in `emaviz/views`, and its tab in `emaviz/page`.  What an engine states as literals — `TITLE`, `HELP`,
`PLACE` among the verbs, `OPTIONS` — is read without importing what computes.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from ema_model.errors import InputError, quoted
from ema_model.members import stated

if TYPE_CHECKING:
    from ema_model.result import Result

_PACKAGE = "ema_model.analyses"


@dataclass(frozen=True)
class Option:
    """One thing that an analysis may be told, besides recordings and actuator; its name is an argument of `analyse`."""

    title: str  # as a control has it
    help: str
    choices: Mapping[str, str]  # what it may be, with what that is called; the first is the usual one


@dataclass(frozen=True)
class Analysis:
    """What the engine's file states."""

    name: str  # of the file, of the verb, and in the page's address
    title: str
    help: str
    place: float  # among the verbs
    options: Mapping[str, Option]

    @property
    def result(self) -> type[Result]:
        """What it answers with: the engine's `RESULT`."""
        return self._engine.RESULT

    def analyse(self, recordings: Sequence[Any], actuator: Any, **options: Any) -> Result:
        """The engine's function of that name; options: those above, which are checked, and `on_progress`."""
        for name in options.keys() - {"on_progress"}:
            self.check(name, options[name])
        return self._engine.analyse(recordings, actuator, **options)

    def check(self, name: str, value: object) -> None:
        """InputError for an option that there is not, or that may not be so."""
        if name not in self.options:
            raise InputError(f"{self.name}: no option {quoted(name)!r}; there are {', '.join(self.options)}")
        if value not in (choices := self.options[name].choices):
            raise InputError(f"{self.name}: {name} must be one of {', '.join(choices)}, not {quoted(value, 40)!r}")

    @property
    def _engine(self) -> Any:
        return importlib.import_module(f"{_PACKAGE}.{self.name}")


@cache
def analyses() -> Mapping[str, Analysis]:
    """All of them by name, in alphabetical order; what computes is not imported."""
    facts = {fact: stated(_PACKAGE, fact) for fact in ("OPTIONS", "TITLE", "HELP", "PLACE")}
    return {
        name: Analysis(
            name,
            facts["TITLE"][name],
            facts["HELP"][name],
            facts["PLACE"][name],
            {option: Option(**told) for option, told in options.items()},
        )
        for name, options in facts["OPTIONS"].items()
    }

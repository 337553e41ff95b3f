"""What every command says: progress, what --json holds, and how that is written with its provenance."""

from __future__ import annotations

import argparse
import json
import logging
import re
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import timedelta
from typing import Annotated, Any, Literal, NotRequired, TypedDict

import numpy as np
from msgspec import Meta

from ema_model.errors import InputError
from ema_model.files.written import whole_file
from emaviz import __version__
from emaviz.text import time_left

# --- what --json of a command holds: the head of all of them, and the results that are a command's own ----------------
# The others stand beside what makes them, in the `summary` of an analysis. A verb's `documents()` names its own, and
# `emaviz schema` prints them.


class VersionsJson(TypedDict):
    """What computed the result."""

    emaviz: Annotated[str, Meta(description="version")]
    numpy: Annotated[str, Meta(description="version")]
    numba: Annotated[str, Meta(description="version")]


class HeadJson(TypedDict):
    """What every result begins with."""

    schema: Annotated[Literal[1], Meta(description="the version of this form; it changes when a field goes")]
    versions: Annotated[VersionsJson, Meta(description="of the program and of what it computes with")]
    seed: Annotated[int, Meta(description="of all random numbers")]
    configuration: Annotated[dict[str, Any], Meta(description="all options, as they were given or defaulted")]


class SimulatedJson(TypedDict):
    """A run that was simulated and written as a recording."""

    file: Annotated[str, Meta(description="the recording")]
    samples: Annotated[int, Meta(description="how many each signal has")]
    k: Annotated[list[float], Meta(description="k1 … k8, 0 … 1")]
    physical: Annotated[dict[str, float], Meta(description="what k means in this actuator, units in the names")]
    effects: Annotated[dict[str, dict[str, float]], Meta(description="settings by the effect's name")]
    rms: Annotated[dict[str, float], Meta(description="of each signal, in the unit that ends its name")]


class RecoveredJson(TypedDict):
    """A whole recording, made of one that was cut off."""

    file: Annotated[str, Meta(description="the whole recording")]
    bytes: Annotated[int, Meta(description="its size")]


class DataSetJson(TypedDict):
    """Recordings of others, that benchmarks compute on."""

    name: Annotated[str, Meta(description="of the set, and of its folder")]
    repository: Annotated[str, Meta(description="of GitHub: owner/name")]
    commit: Annotated[str, Meta(description="of which the files are")]
    licence: Annotated[str, Meta(description="as the repository states it")]
    files: Annotated[dict[str, str], Meta(description="SHA-256 by path in the repository")]


class DataJson(TypedDict):
    """Data sets that are known, and recordings that were made of one."""

    sets: Annotated[list[DataSetJson], Meta(description="all of them, or the one that was named")]
    written: Annotated[list[str], Meta(description="recordings, with --from")]


class EffectParameterFactsJson(TypedDict):
    """One number of an effect."""

    name: Annotated[str, Meta(description="with its unit at the end")]
    meaning: Annotated[str, Meta(description="in words")]
    default: Annotated[float, Meta(description="in its unit")]
    low: Annotated[float, Meta(description="the least that it may be")]
    high: Annotated[float, Meta(description="the most that it may be")]
    integer: Annotated[bool, Meta(description="whether it is whole, as an order")]
    side: Annotated[str | None, Meta(description="of the transmission where it sits: motor, user or neither")]
    per: Annotated[str | None, Meta(description="the side whose angle a number without a unit is counted by")]
    linear: Annotated[list[float] | None, Meta(description="default, low and high where the side's axis is linear")]
    unit: Annotated[str, Meta(description="as shown; empty for a ratio")]
    shown: Annotated[str, Meta(description="its name in files")]
    plausible: Annotated[list[float | None], Meta(description="low and high of a real part; null: no end")]
    plausible_at: Annotated[str, Meta(description="the signal by whose greatest size it counts; empty: none")]
    plausible_of: Annotated[str, Meta(description="the parameter of the actuator that it is a part of; empty: none")]


class EffectJson(TypedDict):
    """A physical effect of the library; one that users write themselves has name, title and keys alone."""

    name: Annotated[str, Meta(description="as --effect takes it")]
    title: Annotated[str, Meta(description="in words")]
    keys: NotRequired[Annotated[dict[str, str], Meta(description="of a user's own: what its table holds")]]
    equation: NotRequired[Annotated[str, Meta(description="what it adds to the model")]]
    source: NotRequired[Annotated[str, Meta(description="where the equation is from")]]
    explanation: NotRequired[Annotated[str, Meta(description="in a few sentences")]]
    parameters: NotRequired[Annotated[list[EffectParameterFactsJson], Meta(description="the first is its size")]]
    severities: NotRequired[Annotated[list[float], Meta(description="three values of the first parameter")]]
    shows: NotRequired[Annotated[str, Meta(description="where it is seen")]]
    against: NotRequired[Annotated[str, Meta(description="the variable that it follows")]]
    mistaken_for: NotRequired[Annotated[str, Meta(description="what looks like it")]]
    family: NotRequired[Annotated[str, Meta(description="mechanics, electrics, sensor or drive")]]
    duplicates: NotRequired[Annotated[str, Meta(description="what a calibration moves in its place; empty: nothing")]]


class EffectsJson(TypedDict):
    """The library of physical effects, or one of it."""

    effects: Annotated[list[EffectJson], Meta(description="in the library's order, users' own last")]


class NewActuatorJson(TypedDict):
    """An actuator file that was written."""

    file: Annotated[str, Meta(description="as given")]
    name: Annotated[str, Meta(description="of the actuator")]
    notes: Annotated[list[str], Meta(description="kinds that were taken or left out, and why, in sentences")]
    missing: Annotated[list[str], Meta(description="what the file lacks, in sentences")]
    implausible: Annotated[list[str], Meta(description="what is hard to believe, in sentences")]


class CheckedActuatorJson(TypedDict):
    """What an actuator file lacks."""

    name: Annotated[str, Meta(description="of the actuator")]
    missing: Annotated[list[str], Meta(description="what the file lacks, in sentences")]
    implausible: Annotated[list[str], Meta(description="what is hard to believe, in sentences")]
    unidentifiable: Annotated[list[str], Meta(description="what the recording does not tell, in sentences")]


class KeyJson(TypedDict):
    """One parameter of an actuator file."""

    path: Annotated[str, Meta(description="section.name")]
    linear: Annotated[str, Meta(description="the name where its axis is linear")]
    meaning: Annotated[str, Meta(description="in words")]
    unit: Annotated[str, Meta(description="of measurement; empty for a ratio")]
    default: Annotated[str, Meta(description="its value where a file is silent; 'needed': a file must say it")]
    tolerance: Annotated[str, Meta(description="the usual one, 1 σ")]
    plausible: Annotated[str, Meta(description="the range of real ones")]
    kinds: Annotated[list[str], Meta(description="kinds of controller and drive that have it")]


class KeysJson(TypedDict):
    """Every parameter that an actuator file can hold."""

    parameters: Annotated[list[KeyJson], Meta(description="by section")]


class InterruptedTrackJson(TypedDict):
    """What is besides in the answer of `track`."""

    interrupted: NotRequired[Annotated[bool, Meta(description="true where not all flights were identified")]]
    flights_identified: NotRequired[Annotated[int, Meta(description="how many were, before the interrupt")]]
    flights_named: NotRequired[Annotated[int, Meta(description="how many there are")]]


class SavedActuatorJson(TypedDict):
    """The improved model, written as an actuator file and simulated again from there."""

    file: Annotated[str, Meta(description="as given with --save-actuator")]
    verified_rmse: Annotated[float | None, Meta(description="of the saved model, pooled over signals, in floors")]
    verified_holdout_rmse: Annotated[float | None, Meta(description="the same of what was not fitted; null: nothing")]


class SavedModelJson(TypedDict):
    """What is besides in the answer of `discover`."""

    saved_actuator: NotRequired[Annotated[SavedActuatorJson, Meta(description="with --save-actuator")]]


class InterruptedCampaignJson(TypedDict):
    """What is besides in the answer of a campaign's run."""

    interrupted: NotRequired[Annotated[bool, Meta(description="true where a run was interrupted")]]


class PlannedJson(TypedDict):
    """What a campaign would compute (--dry-run)."""

    tasks: Annotated[int, Meta(description="how many there are")]
    there: Annotated[int, Meta(description="how many are computed already")]
    workers: Annotated[int, Meta(description="processes")]
    seconds: Annotated[float, Meta(description="s, that the rest takes, about")]


# --- JSON with its provenance, and progress on a terminal or in a log -------------------------------------------------

_LINE_EVERY_S = 10.0  # of a log

_LOG = logging.getLogger("emaviz")


def write_json(arguments: Any, result: Mapping[str, Any]) -> None:
    """Writes a result with its schema, versions, seed and options to --json, whole or not at all; nothing without it.

    InputError if it cannot be written.
    """
    path = arguments.json
    if path is None:
        return
    import numba  # takes a third of a second

    head: HeadJson = {
        "schema": 1,
        "versions": {"emaviz": __version__, "numpy": np.__version__, "numba": numba.__version__},
        "seed": getattr(arguments, "seed", 0),
        "configuration": configuration(arguments),
    }
    try:
        with whole_file(path) as draft, open(draft, "w", encoding="utf-8") as file:
            json.dump({**head, **result}, file, indent=1, default=_plain, ensure_ascii=False, allow_nan=False)
            file.write("\n")
    except OSError as error:
        raise InputError(f"--json {path}: cannot be written ({error.strerror}); check the disk") from None


def configuration(arguments: Any) -> dict[str, Any]:
    """The options as they were given or defaulted."""
    return {name: value for name, value in vars(arguments).items() if name != "run"}


def say_not_written(arguments: Any, *options: str) -> None:
    """Says which of these options have no file, since the command was interrupted."""
    given = [f"--{name.replace('_', '-')}" for name in options if getattr(arguments, name)]
    if given:
        print(f"{', '.join(given)}: not written, since the answer is not whole")


def be_verbose() -> logging.Logger:
    """What says on stderr what is done, a line each with the time of day."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    _LOG.handlers = [handler]
    _LOG.setLevel(logging.INFO)
    return _LOG


class Progress:
    """Says on stderr how far a long command is, unless it has --quiet.

    On a terminal it is one line that changes, from the first second on; elsewhere a new line every ten seconds, with
    the time since the command began and, where that can be said, about how long it will still take.
    """

    def __init__(self, arguments: argparse.Namespace, clock: Callable[[], float] = time.monotonic) -> None:
        """clock(): s, of any zero."""
        self._quiet = getattr(arguments, "quiet", False)
        self._clock = clock
        self._started = self._shown = clock()
        self._drawn = False
        self._said: tuple[str, float | None] = ("", None)
        self._over = threading.Event()  # for the thread that writes while nothing new is said
        self._writer: threading.Thread | None = None
        self._writing = threading.Lock()
        self._what = ""  # of the verbose log

    def show(self, text: str, share: float | None = None) -> None:
        """Replaces the line, ten times a second at most; share: of the whole work that is done, 0 … 1, if known."""
        if self._quiet:
            return
        self._said = text, share
        now = self._clock()
        if _LOG.isEnabledFor(logging.INFO):
            self._log_each(text, now)
            return
        if not sys.stderr.isatty():
            self.log()
            self._keep_logging()
            return
        if now - self._started < 1.0 or now - self._shown < 0.1:
            return
        self._shown, self._drawn = now, True
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)

    def log(self) -> None:
        """Writes what was said last as a line of its own, if the last line was ten seconds ago."""
        with self._writing, suppress(OSError, ValueError):  # a log that is full or closed ends no computing
            now = self._clock()
            if now - self._shown < _LINE_EVERY_S:
                return
            self._shown = now
            (text, share), elapsed_s = self._said, now - self._started
            left = "" if share is None else time_left(elapsed_s, share)
            print(f"[{timedelta(seconds=int(elapsed_s))}] {text}{left and f', {left}'}", file=sys.stderr, flush=True)

    def _log_each(self, text: str, now: float) -> None:
        """Each thing that begins, and how far it is once a second."""
        what = re.sub(r"[-+.\d]+", "", text)
        if what != self._what or now - self._shown >= 1.0:
            self._what, self._shown = what, now
            _LOG.info("%s", text)

    def done(self) -> None:
        """Takes the line away; nothing more is said until the next `show`."""
        if self._writer is not None:  # it ends here: one that Python finds at its own end can abort the process
            self._over.set()
            self._writer.join(1.0)
            self._writer = None
        if self._drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._drawn = False

    def _keep_logging(self) -> None:
        if self._writer is not None:
            return
        self._over = over = threading.Event()

        def repeat() -> None:
            while not over.wait(1.0):
                self.log()

        self._writer = threading.Thread(target=repeat, name="progress", daemon=True)
        self._writer.start()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return str(value)

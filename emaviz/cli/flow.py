"""The one flow of every verb that reads recordings: read, compute, save, write, print, record, report.

A verb states its options and one function that computes; what comes before and after stands here once.  The recording
and the report come last: if one of them fails, the answer and the other are there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from ema_model.actuator import Actuator, save_actuator
from ema_model.errors import InputError
from emaviz.cli import option_values, output
from emaviz.cli.ending import ExitCode

if TYPE_CHECKING:
    from ema_model.result import Result

Write = Callable[[str, Mapping[str, Any]], None]  # a file's path, and the options that the answer was computed with


@dataclass(frozen=True)
class Answer:
    """What a verb found, and how it is written."""

    words: object  # str() of it is printed
    document: Mapping[str, Any]  # of --json
    actuator: Actuator | None = None  # of --save-actuator
    record: Write | None = None  # of --record; imports rerun, which takes a second
    report: Write | None = None  # of --report; imports plotly, which takes a second
    is_whole: bool = True  # else it was interrupted, and its model is not saved
    saved: Callable[[], tuple[str, Mapping[str, Any]]] | None = None  # of the saved model: words, JSON


def of_result(result: Result, actuator: Actuator | None = None) -> Answer:
    """What a verb finds that answers with a result: it says, shows and exports itself.

    actuator: of --save-actuator.
    """

    def write(path: str, configuration: Mapping[str, Any]) -> None:
        from emaviz.views.export import export

        export(result, path, configuration)

    return Answer(result, result.to_dict(), actuator, record=write, report=write)


Read = TypeVar("Read")  # recordings, or recordings by unit


def run(
    arguments: argparse.Namespace,
    actuator: Actuator,
    compute: Callable[[Read, Read, output.Progress], Answer],
    read: Callable[[argparse.Namespace, Actuator, output.Progress], tuple[Read, Read]] = option_values.read_set,
) -> ExitCode:
    """Reads what is fitted and what is held out, computes, and finishes."""
    progress = output.Progress(arguments)
    try:
        fitted, held = read(arguments, actuator, progress)
        return finish(arguments, compute(fitted, held, progress), progress)
    finally:
        progress.done()


def finish(arguments: argparse.Namespace, answer: Answer, progress: output.Progress) -> ExitCode:
    """Saves the model, writes the JSON, prints, records and reports."""
    words, document = str(answer.words), dict(answer.document)
    if answer.is_whole and answer.actuator is not None and getattr(arguments, "save_actuator", None):
        save_actuator(answer.actuator, arguments.save_actuator)
        if answer.saved is not None:
            progress.show("simulating the saved model")
            line, of_saved = answer.saved()
            words, document = f"{words}\n\n{line}", {**document, **of_saved}
    progress.done()
    output.write_json(arguments, document)
    print(words, flush=True)
    if not answer.is_whole:
        output.say_not_written(arguments, "save_actuator")
    configuration = output.configuration(arguments)
    failed: list[Exception] = []
    for option, write in (("record", answer.record), ("report", answer.report)):
        if write is not None and (path := getattr(arguments, option, None)):
            progress.show(f"writing the {option.replace('record', 'recording')}")
            try:
                write(path, configuration)
            except (InputError, OSError) as error:
                failed.append(error)
    progress.done()
    if failed:
        raise InputError("; ".join(map(str, failed))) from failed[0]
    return ExitCode.DONE if answer.is_whole else ExitCode.INTERRUPTED

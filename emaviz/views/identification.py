"""An identification: the faults, how the model fits with them, how the search went; and its .rrd."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from ema_model import faults
from ema_model.actuator.actuator import readings, sentences
from ema_model.actuator.parameters import on_axes
from ema_model.errors import InputError
from ema_model.identification.run import CORRECTED, Identification, algorithm_title, verdict
from ema_model.quantities import amount, number
from emaviz import __version__
from emaviz.figures import identification, theme
from emaviz.recording.entry import RecordingError
from emaviz.text.verdicts import Meaning, sure_words
from emaviz.views import Bullets, Columns, Line, Markup, Piece, Row, Section, View

_MARK = "\x1e"  # before a k that is surely not healthy


def _faults(answer: Identification) -> Iterator[Piece]:
    """In words, as bars, in numbers: k1 … k8 with their intervals, and what they mean."""
    sure, actuator = answer.uncertainty, answer.actuator
    yield Markup(sure_words(answer))
    yield Markup(
        identification.fault_bars(
            answer.k, actuator, answer.truth, sure.interval90, sure.alarms, sure.detectable, sure.adequate
        )
    )
    rows = [
        [
            f"{fault.name} {fault.title}",
            phrase,
            f"{_MARK if fault.name in sure.alarms else ''}{answer.k[i]:.4f}",
            f"{sure.interval90[i, 0]:.4f} … {sure.interval90[i, 1]:.4f}",
            *([] if answer.truth is None else [f"{answer.truth[i]:.4f}"]),
        ]
        for i, (fault, phrase) in enumerate(zip(faults.FAULTS, sentences(answer.k, actuator)))
    ]
    heads = ["Fault", "meaning", "k", "90 % interval", *([] if answer.truth is None else ["truth"])]
    yield Columns(heads, rows, marked=_MARK)
    physical = [[name.replace("_", " "), number(value)] for name, value in readings(answer.k, actuator).items()]
    yield Columns(["Physical reading", "value"], physical, text_columns=1)
    yield Bullets(sure.warnings, "warning")


def _fit(answer: Identification) -> Iterator[Piece]:
    """The measured current of each recording beside the Monitor Model's at the answer, and what is left."""
    known = np.isfinite(answer.holdout_rmse)
    beside = f"; {amount(answer.holdout_rmse, 'A')} on the recordings that were not fitted" if known else ""
    yield Line(
        f"Corrected error {amount(answer.corrected_rmse, 'A')}; as it is drawn here, uncorrected, "
        f"{amount(answer.rmse, 'A')}{beside}. {CORRECTED}"
    )
    if answer.objective is not None:
        yield from (Row([chart]) for chart in identification.figures(answer.objective, answer.k))


def _convergence(answer: Identification) -> Iterator[Piece]:
    """The best error of each iteration."""
    chart = theme.new("Best error of each iteration", "Iteration", identification.error_title(True))
    drawn = {"color": identification.colour(answer.algorithm), "width": 2}
    chart.add_trace(go.Scatter(y=answer.corrected_history, mode="lines", line=drawn, showlegend=False))
    chart.update_yaxes(type="log")
    ended = ", stopped by the user" if answer.stopped else ", then a least-squares fit" if answer.polished else ""
    told = f"{algorithm_title(answer.algorithm)}{ended}: {answer.evaluations} simulations"
    yield Line(f"{told} in {answer.elapsed_s:.2f} s.")
    yield Row([chart], 300)


def _made(answer: Identification, configuration: Mapping[str, Any]) -> Iterator[Piece]:
    """Options, and the actuator's parameters that the fit moved beside k."""
    given = {name: value for name, value in configuration.items() if value not in (None, [], "")}
    actuator = answer.actuator
    rows = [[name.replace("_", " "), value] for name, value in ({"actuator": actuator.name} | given).items()]
    yield Columns(["Setting", "value"], [*rows, ["emaviz", __version__]])
    moved = [
        [on_axes(path, actuator.axes).path, number(float(actuator.value(path)), 4), number(value, 4)]
        for path, value in answer.parameters.items()
    ]
    if moved:
        yield Columns(["Moved beside k", "file", "fitted"], moved, text_columns=1)


def _record(answer: Identification, path: Path, configuration: Mapping[str, Any]) -> None:
    """The answer and what was measured, without the iterations' models, which are drawn while a search runs."""
    from emaviz.recording.identification import IdentificationStory  # rerun takes a second to import

    objective = answer.objective
    if objective is None:
        raise InputError("the recordings of this identification are not at hand; identify them anew")
    try:
        story = IdentificationStory(
            path, objective, objective.measurements[0], "measurement", answer.truth, configuration
        )
    except RecordingError as error:
        raise InputError(str(error)) from None
    story.finish(answer)
    if story.failed:
        raise InputError(story.failed)


def _title(answer: Identification) -> str:
    told = verdict(answer)
    return told[:1].upper() + told[1:]


def _lead(answer: Identification) -> str:
    measured = [] if answer.objective is None else answer.objective.measurements
    return f"{answer.actuator.name} against {', '.join(one.name or 'a simulated run' for one in measured)}"


def _meaning(answer: Identification) -> Meaning:
    sure = answer.uncertainty
    return "bad" if sure.uninformative or not sure.adequate else "good" if sure.healthy else "found"


def _table(answer: Identification) -> Mapping[str, ArrayLike]:
    """A row for each k."""
    low, high = answer.uncertainty.interval90.T
    known = {} if answer.truth is None else {"truth": answer.truth}
    return {"fault": np.array(faults.NAMES), "k": answer.k, "low90": low, "high90": high, **known}


VIEW = View(
    of=Identification,
    name="identification",
    title=_title,
    lead=_lead,
    sections=(
        Section("Faults", "faults", of=_faults),
        Section("Fit", "fit", of=_fit),
        Section("Convergence", "convergence", of=_convergence),
    ),
    meaning=_meaning,
    columns=_table,
    record=_record,
    made=_made,
)

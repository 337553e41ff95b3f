"""One amount reads alike in the sentence, the terminal, the page, the report and the recording."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from ema_model.comparison.result import SignalError, held_out
from ema_model.comparison.verdict import judge
from emaviz.page.compare.result import numbers
from emaviz.recording.writer import written
from emaviz.report.comparison import ErrorsPerSignal

SIZES = {  # of the error and its floor, A: as both are to be read
    (0.2, 0.12): ("0.200", "0.120", "A"),
    (0.2, 0.05): ("0.200", "0.0500", "A"),
    (0.35, 0.3): ("0.350", "0.300", "A"),
    (0.0352, 0.031): ("35.2", "31.0", "mA"),
    (12.3, 0.4): ("12.3", "0.400", "A"),
}


@pytest.mark.parametrize("sizes", SIZES)
def test_an_error_reads_alike_wherever_it_is_told(sizes, comparison):
    rmse, floor = sizes
    size, least, unit = SIZES[sizes]
    error = SignalError(rmse, 3.0 * rmse, 0.1, floor, 0.8 * rmse)
    told = replace(comparison, signals={"current_A": error}, recordings=[])
    sentence = judge(comparison.residuals, comparison.signals | told.signals, None, comparison.actuator).sentences[-1]
    assert f"{size} {unit} rms" in sentence and f"{least} {unit}" in sentence
    row = next(line for line in str(told).splitlines() if line.startswith("  Equivalent current ")).split()
    assert row[3] == size and row[4] == least and row[-1] == unit  # behind its name and what it was before
    page, notebook = numbers(told), told._repr_html_()
    report = ErrorsPerSignal().body(told, None)  # pyright: ignore[reportArgumentType]
    for one in (page, notebook, report):
        cells = re.findall(r">([^<>]+)</td>", one)
        at = cells.index("Equivalent current")
        assert cells[at + 2 : at + 4] == [size, least] and unit in cells[at:]
    recording = written("The answer", told.document.blocks)
    assert f" | {size} | {least} | " in recording and f" | {unit} |" in recording
    unseen = replace(comparison.recordings[0], errors=told.signals)
    assert f"{size} {unit} (floor {least} {unit}: " in held_out(unseen)


def test_an_order_reads_alike_in_the_sentence_and_in_the_terminal(comparison):
    told = judge(comparison.residuals, comparison.signals, None, comparison.actuator)
    [sentence] = [one for one in told.sentences if "times a turn" in one]
    order, amount = re.findall(r"repeats (\d+) times a turn with an amplitude of ([^ ]+ [^ ]+)\.", sentence)[0]
    assert f"{order} ({amount})" in str(replace(comparison, orders=told.orders))

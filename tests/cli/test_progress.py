"""How far a long command is: one line that changes on a terminal, a line every ten seconds in a log."""

from __future__ import annotations

import argparse
import io
import sys

import pytest
from options_of import command_parser, every_command

from ema_model.campaign import run as campaign_run
from emaviz.cli import main, output
from emaviz.cli.parser import parser_of


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def progress(clock):
    made = []

    def progress(**options):
        made.append(output.Progress(argparse.Namespace(**options), clock))
        return made[-1]

    yield progress
    for one in made:
        one.done()


def at(clock, seconds):
    clock.now = 100.0 + seconds


def test_a_log_has_a_line_every_ten_seconds(progress, clock, capsys):
    shown = progress()
    for seconds in range(36):
        at(clock, seconds)
        shown.show(f"flight {seconds + 1} of 60: {seconds}.csv", seconds / 60.0)
    assert capsys.readouterr().err.splitlines() == [
        "[0:00:10] flight 11 of 60: 10.csv, about 50 s left",
        "[0:00:20] flight 21 of 60: 20.csv, about 40 s left",
        "[0:00:30] flight 31 of 60: 30.csv, about 30 s left",
    ]


def test_a_log_goes_on_while_nothing_new_is_said(progress, clock, capsys):
    shown = progress()
    shown.show("calibrating")
    at(clock, 9.9)
    shown.log()
    assert capsys.readouterr().err == ""
    at(clock, 3725.0)
    shown.log()
    shown.log()
    assert capsys.readouterr().err == "[1:02:05] calibrating\n"


def test_a_short_command_writes_nothing_to_a_log(progress, clock, capsys):
    shown = progress()
    for seconds in range(10):
        at(clock, seconds)
        shown.show("reading")
    shown.done()
    assert capsys.readouterr().err == ""


def test_a_terminal_has_one_line_that_changes(progress, clock, monkeypatch):
    terminal = type("Terminal", (io.StringIO,), {"isatty": lambda self: True})()
    monkeypatch.setattr(sys, "stderr", terminal)
    shown = progress()
    for seconds in (0.5, 1.5, 12.0):
        at(clock, seconds)
        shown.show(f"at {seconds}", 0.5)
    shown.done()
    assert terminal.getvalue() == "\r\x1b[Kat 1.5\r\x1b[Kat 12.0\r\x1b[K"


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_quiet_command_says_nothing(progress, clock, monkeypatch, is_terminal):
    stream = type("Stream", (io.StringIO,), {"isatty": lambda self: is_terminal})()
    monkeypatch.setattr(sys, "stderr", stream)
    shown = progress(quiet=True)
    for seconds in (0.5, 5.0, 20.0):
        at(clock, seconds)
        shown.show("calibrating")
    assert stream.getvalue() == ""


def test_a_log_that_cannot_be_written_ends_nothing(progress, clock, monkeypatch):
    class Full(io.StringIO):
        def write(self, text):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys, "stderr", Full())
    shown = progress()
    at(clock, 20.0)
    shown.show("calibrating")


@pytest.mark.parametrize("command", every_command())
def test_every_command_can_be_quiet(command):
    assert {"-q", "--quiet"} <= {name for action in command_parser(command)._actions for name in action.option_strings}


def test_of_verbs_each_can_be_quiet_and_all_of_them():
    for given in (["actuator", "--quiet", "keys"], ["actuator", "keys", "--quiet"]):
        assert parser_of("actuator").parse_args(given).quiet


def test_a_quiet_campaign_says_nothing_and_another_says_how_far_it_is(tmp_path, monkeypatch, capsys, clock):
    """Told by the clock of `Progress`, at whatever a plan's tasks say."""

    def run_plan(plan, folder, scheduler, *, retry, on_progress):
        for computed in (1, 2):
            clock.now += 15.0
            on_progress(
                campaign_run.Status(total=4, there=0, computed=computed, workers=2, left_s=30.0 - 15 * computed)
            )
        raise KeyboardInterrupt

    monkeypatch.setattr("ema_model.campaign.run_plan", run_plan)
    monkeypatch.setattr(output.Progress.__init__, "__defaults__", (clock,))
    line = ["campaign", "robust_quick", "--out", str(tmp_path / "out")]
    assert main(line) == 130
    assert capsys.readouterr().err.splitlines() == [
        "[0:00:15] 1 of 4 tasks, 2 workers, 15 s left",
        "[0:00:30] 2 of 4 tasks, 2 workers, 0 s left",
    ]
    assert main([*line, "--quiet"]) == 130
    assert capsys.readouterr().err == ""

"""What a command writes never damages what it reads, nor anything else that was measured; told before any work."""

from __future__ import annotations

import os

import pytest
from options_of import TEXT, command_parser, needed, options_with_values

from ema_model.errors import InputError
from emaviz.cli import main
from emaviz.cli.options import Folder, Input, Number, Output, check_files

OPTIONS = options_with_values()
OUTPUTS = [one for one in OPTIONS if isinstance(one[2].type, Output)]
KEPT = [one for one in OUTPUTS if one[2].type.is_kept]
PAIRS = [
    (command, source, target)
    for command, _, target in OUTPUTS
    for other, _, source in OPTIONS
    if other == command and isinstance(source.type, Input)
]


# Every pair in one way, and one pair of each command in all: what is one file is told in one place.
SPELLINGS = ("same", "other folder", "link", "hard link", "link to the input")
FIRST = {command: (source, target) for command, source, target in reversed(PAIRS)}
SPELLED = [
    pytest.param(command, source, target, spelling, id=f"{spelling}-{command} {source.dest} {target.dest}")
    for command, source, target in PAIRS
    for spelling in (SPELLINGS if FIRST[command] == (source, target) else SPELLINGS[:1])
]


def flag(action, path):
    return [*action.option_strings[:1], str(path)]


def refused(arguments, capsys):
    """The one line that a command says instead of beginning."""
    assert main([str(argument) for argument in arguments]) == 2
    told = capsys.readouterr().err
    assert told.startswith("emaviz: ") and told.count("\n") == 1, told
    return told


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    """A working folder with a file that no reader takes: who begins to work before the check says something else."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.csv").write_text("measured\n")


@pytest.mark.parametrize("command, name, action", OPTIONS, ids=[f"{c} {n}" for c, n, _ in OPTIONS])
def test_every_option_says_what_it_is(command, name, action):
    """A new option must be declared as a file that is read or written, as a number, or be listed as a text."""
    declared = isinstance(action.type, (Input, Output, Folder, Number)) or action.choices is not None
    assert declared != (name in TEXT)
    if isinstance(action.type, Output) and action.type.is_kept:
        assert "--force" in command_parser(command)._option_string_actions


@pytest.mark.parametrize("command, source, target, spelling", SPELLED)
def test_no_output_is_an_input(command, source, target, spelling, tmp_path, capsys):
    real, other = tmp_path / "in.csv", tmp_path / "other.csv"
    if spelling == "same":
        other = real
    elif spelling == "other folder":
        other = tmp_path / ".." / tmp_path.name / "in.csv"
    elif spelling == "hard link":
        os.link(real, other)
    elif spelling == "link":
        other.symlink_to(real)
    else:
        other.symlink_to(real)
        real, other = other, real
    least = needed(command, "in2.csv", source)
    if not target.option_strings:
        least.remove(f"needed{target.type.suffixes[0]}")
    if "in2.csv" in least or "needed.csv" in least:
        (tmp_path / "in2.csv").write_text("measured\n")
    told = refused([*least, *flag(source, real), *flag(target, other)], capsys)
    assert "name another file" in told and f"{''.join(target.option_strings[:1])} {other}: is" in told
    assert (tmp_path / "in.csv").read_text() == "measured\n"
    assert set(os.listdir(tmp_path)) <= {"in.csv", "in2.csv", "other.csv"}


def test_two_outputs_are_two_files(tmp_path, capsys):
    """Names that a link makes one, with the file there and without."""
    (tmp_path / "b.html").symlink_to("a.json")
    both = ["compare", "in.csv", "--json", "a.json", "--report", "b.html"]
    assert "--json a.json: is what --report names" in refused(both, capsys)
    (tmp_path / "a.json").write_text("{}")
    assert "is what --report names" in refused(both, capsys)


@pytest.mark.parametrize("target", ["in.toml", "IN.toml", "recordings.toml"])
def test_the_side_file_s_place_is_kept_free(target, capsys):
    """Whether it is there or not: what is written there would be read with the recording."""
    arguments = ["discover", "in.csv", "--save-actuator", target, "--force"]
    assert "is the place of the side file of in.csv" in refused(arguments, capsys)


@pytest.mark.parametrize("target", ["in.toml", "shared.toml"])
def test_the_side_file_is_kept(target, tmp_path, capsys):
    (tmp_path / "in.toml").write_text("schema = 1\n")
    (tmp_path / "shared.toml").symlink_to("in.toml")
    arguments = ["discover", "in.csv", "--save-actuator", target, "--force"]
    assert "is the place of the side file of in.csv" in refused(arguments, capsys)


def test_a_recorded_command_is_an_input(capsys):
    told = refused(["simulate", "--command", "in.csv", "--out", "in.csv", "--force"], capsys)
    assert "--out in.csv: is what --command names" in told


def parsed(arguments):
    verbs = 2 if arguments[0] == "actuator" else 1
    parser = command_parser(" ".join(arguments[:verbs]))
    return parser, parser.parse_args([str(argument) for argument in arguments[verbs:]])


@pytest.mark.parametrize("command, name, action", KEPT, ids=[f"{c} {n}" for c, n, _ in KEPT])
def test_what_was_measured_is_replaced_with_force_only(command, name, action, tmp_path, capsys):
    old = tmp_path / f"old{action.type.suffixes[0]}"
    old.write_text("old")
    arguments = [*needed(command, "in.csv", action), *flag(action, old)]
    assert "exists already; name another file, or replace it with --force" in refused(arguments, capsys)
    assert old.read_text() == "old"
    check_files(*parsed([*arguments, "--force"]))


@pytest.mark.parametrize("name", ["--json r.json", "--report r.html", "--report r.htm"])
def test_results_and_reports_are_replaced_as_usual(name, tmp_path):
    option, file = name.split()
    (tmp_path / file).write_text("old")
    check_files(*parsed(["compare", "in.csv", option, file]))


@pytest.mark.parametrize("command, name, action", OUTPUTS, ids=[f"{c} {n}" for c, n, _ in OUTPUTS])
def test_a_place_that_cannot_be_written_is_told(command, name, action, tmp_path, capsys):
    suffix = action.type.suffixes[0]
    (tmp_path / f"folder{suffix}").mkdir()
    (tmp_path / f"into{suffix}").symlink_to(tmp_path / "none" / f"a{suffix}")
    os.mkfifo(tmp_path / f"pipe{suffix}")
    least = needed(command, "in.csv", action)
    for place, says in (
        ("a.txt", f"the name must end in {suffix}"),
        ("a", f"the name must end in {suffix}"),
        (f"nowhere/a{suffix}", "the folder nowhere does not exist"),
        (f"into{suffix}", f"the folder {tmp_path / 'none'} does not exist"),
        (f"folder{suffix}", "is a folder"),
        (f"pipe{suffix}", "is not a regular file"),
    ):
        assert says in refused([*least, *flag(action, place)], capsys)
    (tmp_path / f"dangling{suffix}").symlink_to(tmp_path / f"new{suffix}")
    check_files(*parsed([*least, *flag(action, f"dangling{suffix}")]))


def test_a_folder_without_permission_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(InputError, match=r"--json a\.json: no permission to write in"):
        check_files(*parsed(["effects", "--json", "a.json"]))


def test_drafts_of_killed_processes_go_where_the_outputs_are(tmp_path):
    (tmp_path / ".0123456789abcdef.part").write_text("half")
    check_files(*parsed(["effects", "--json", "a.json"]))
    assert os.listdir(tmp_path) == ["in.csv"]

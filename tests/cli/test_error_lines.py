"""Whatever foreign text an error quotes, it is told in one line, of bounded length, that no terminal obeys."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.challenges.challenge import sealed_challenge
from ema_model.commands import command
from ema_model.effects import find
from ema_model.effects.user import user_torque
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.recordings import ColumnMapping, MappedColumn
from ema_model.recordings.column_mapping import parse_mapping
from ema_model.recordings.read import read_measurement
from emaviz.cli import main
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder
from emaviz.session.files import RecordedRuns
from emaviz.session.settings import Settings

LONG = "A" * 50_000
STRANGE = "A\x1b[31mred\x1b]0;title\x07 a\nsecond line\r\x00 b\u202egnp.exe\u2066 c\u2028 d\x9b31m\x7f\ud800"
# in TOML and JSON they stand as escapes, so that the reader gives the signs themselves
TEXTS = {"long": LONG, "strange": STRANGE.replace("\ud800", "")}


def one_line(told):
    """An error's line as it must be, whatever it quotes."""
    line = str(told)
    assert line.isprintable() and line
    assert len(line) <= 1000 and line.count("A" * 301) == 0
    return line


@pytest.fixture(params=TEXTS)
def text(request):
    return TEXTS[request.param]


@pytest.mark.parametrize("most", [1, 40, 300])
def test_a_piece_is_cut_and_its_signs_are_seen(most):
    for given in (LONG, STRANGE, "\u202e" * 1000, "\n" * 1000, 10**400, [LONG]):
        assert len(quoted(given, most)) <= most and quoted(given, most).isprintable()
    assert quoted("a b·ω_₃") == "a b·ω_₃" and quoted("x" * 300) == "x" * 300
    assert quoted("a\n\x1b\x00\u202e\x7f\u00a0\ud800") == "a␊␛␀⟨U+202E⟩␡ ⟨U+D800⟩"


def test_a_line_is_one_whatever_is_put_into_it():
    one_line(InputError(f"{LONG}: {STRANGE}"))
    one_line(InputError("\u202e" * 999))
    head = one_line(InputError(f"file.csv: {LONG}; do this"))
    assert head.startswith("file.csv: ") and head.endswith("; do this")
    again = InputError(head)
    assert str(again) == head and str(InputError()) == ""


def test_a_name_like_it_is_suggested(text):
    assert did_you_mean("curent", ["speed", "current"]) == "; did you mean 'current'?"
    assert did_you_mean("k9", ["current"]) == did_you_mean("k9", []) == ""
    one_line(InputError(f"no column{did_you_mean(text, iter([text]))}"))


def test_column_names_and_cells(tmp_path, text):
    cell = text.replace("\n", "").replace("\r", "").replace("\x00", "").replace("\u2028", "")
    rows = "".join(f"{i},{i},1\n" for i in range(150))
    for name, content in {
        "name.csv": f"{cell},b,c\n{rows}",
        "cell.csv": f"time_s,current_A,c\n{rows}151,{cell},1\n",
        "twice.csv": f"time_s,{cell},{cell}\n{rows}",
    }.items():
        path = tmp_path / name
        path.write_text(content, encoding="utf-8")
        with pytest.raises(InputError) as told:
            read_measurement(path)
        one_line(told.value)
    path = tmp_path / "mapped.csv"
    column = cell[:900]  # as long as a column's name may be
    path.write_text(f"time_s,{column},c\n{rows}1e3,nonsense,1\n", encoding="utf-8")
    mapping = parse_mapping([f"current_A={column}"])
    with pytest.raises(InputError) as told:
        read_measurement(path, mapping=mapping)
    assert "nonsense" in one_line(told.value)
    name = text.replace("\x00", "").replace("/", "")
    np.savez(tmp_path / "c.npz", **{"time_s": np.arange(150.0), name: np.ones(3)})
    with pytest.raises(InputError) as told:
        read_measurement(tmp_path / "c.npz", mapping=ColumnMapping((MappedColumn("current_A", name),)))
    one_line(told.value)


@pytest.mark.parametrize("form", ["{}=x", "current_A={}[{}]", "current_A=i[A, {}=1]", "current_A=i[A, sign={}]", "{}"])
def test_mappings(text, form):
    plain = text.replace("[", "").replace("]", "").replace("\n", "")
    with pytest.raises(InputError) as told:
        parse_mapping([form.format(*[plain] * form.count("{}"))])
    one_line(told.value)


@pytest.mark.parametrize(
    "form",
    [
        "{key} = 1",
        "schema = {text}",
        "[motor]\n{key} = 1",
        "[motor]\nresistance_ohm = {text}",
        "[motor]\nresistance_ohm = {{ value = 1.0, sigma = 0.1, free = {text} }}",
        "[axes]\nmotor = {text}",
        "[axes]\n{key} = 1",
        "[model]\n{key} = 1",
        "[model]\ntorque_known = {text}",
        "[effects.{key}]\na = 1",
        "[effects]\n{key} = 1",
        "[effects.cogging_torque]\n{key} = 1",
        "[effects.user_torque]\nexpression = {text}",
        '[effects.user_torque]\nexpression = "c*omega"\nc = {text}',
        '[effects.user_torque]\nexpression = "c*omega"\nc = 1\n{key} = 1',
        "[recordings]\n{key} = 1",
        "[[recordings.where]]\n{key} = 1",
        '[[recordings.where]]\nmatch = "*"\nset = {{ {key} = 1 }}',
        "[motor",
    ],
)
def test_actuator_files(tmp_path, text, form):
    path = tmp_path / "a.toml"
    # JSON writes a text, or a key in quotes, as TOML does
    path.write_text(form.format(key=json.dumps(text), text=json.dumps(text)).replace("\\u007f", "\\u007F"))
    with pytest.raises(InputError) as told:
        load_actuator(path)
    one_line(told.value)


def test_names_that_the_model_does_not_know(text):
    actuator = replace(load_actuator(), name=text)
    for ask in (
        lambda: find(text),
        lambda: find("cogging_torque").settings({text: 1.0}),
        lambda: command(text),
        lambda: command("chirp", {text: 1.0}),
        lambda: command("chirp", {"end_Hz": text}),
        lambda: actuator.with_values({text: 1.0}),
        lambda: user_torque(text),
        lambda: user_torque("c*omega", {text: (0.0, 1.0)}),
    ):
        with pytest.raises(InputError) as told:
            ask()
        one_line(told.value)


def test_what_a_browser_and_a_session_send(tmp_path, text):
    settings, folder = Settings(), DataFolder(tmp_path)
    for change in (
        lambda: settings.set("duration_s", text),
        lambda: settings.set("monitor", text),
        lambda: settings.set("algorithms", [text]),
        lambda: settings.set_effect(text, text, 1.0),
        lambda: settings.restore({"effects": {text: {text: text}}}),
        lambda: settings.restore({"command_settings": {"chirp": {text: 1}}}),
        lambda: folder.measurement(text),
        lambda: folder.place(f"{text}.exe"),
        lambda: RecordedRuns(tmp_path).entry(f"{text}.rrd"),
    ):
        with pytest.raises(InputError) as told:
            change()
        one_line(told.value)
    path = tmp_path / "s.emaviz"
    for document in ({"schema": text}, {"schema": [text]}, text):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(session_file._DOCUMENT, json.dumps(document))
        with pytest.raises(InputError) as told:
            session_file.read_session(path, {}, folder)
        one_line(told.value)


def test_sealed_challenges(tmp_path, text):
    inside = io.BytesIO()
    with zipfile.ZipFile(inside, "w") as archive:
        archive.writestr(text.replace("\x00", ""), b"")
    path = tmp_path / "one.challenge"
    path.write_bytes(inside.getvalue())
    with pytest.raises(InputError) as told:
        sealed_challenge(path)
    one_line(told.value)


@pytest.mark.parametrize("name", [LONG[:250], STRANGE.replace("\x00", "").replace("\ud800", "\udcff")])
def test_file_names(tmp_path, name):
    for suffix, read in ((".csv", read_measurement), (".toml", load_actuator), (".challenge", sealed_challenge)):
        path = tmp_path / (name[: 255 - len(suffix) - 10] + suffix)
        for _ in ("missing", "wrong"):
            with pytest.raises(InputError) as told:
                read(path)
            one_line(told.value)
            path.write_bytes(b"[nothing\xff")


@pytest.mark.parametrize(
    "options",
    [
        ["--fault", "{}=1"],
        ["--fault", "k1={}"],
        ["--set", "{}"],
        ["--set", "{}=1"],
        ["--command", "{}"],
        ["--effect", "{}"],
        ["--effect", "cogging_torque:{}"],
        ["--effect", "cogging_torque:{}=1"],
        ["--effect", "user_torque:expression={}"],
        ["--effect", "user_torque:expression=c*omega,{}"],
        ["--actuator", "{}"],
    ],
)
def test_options_of_the_command_line(tmp_path, capsys, text, options):
    given = [option.format(text.replace("\x00", "")) for option in options]
    assert main(["simulate", *given, "--out", str(tmp_path / "x.csv")]) != 0
    *_, line = capsys.readouterr().err.rstrip("\n").split("\n")
    one_line(line)

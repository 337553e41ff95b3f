"""What --json of each command holds is stated by types, whose schema the program prints; what exit codes mean."""

from __future__ import annotations

import json
from typing import Annotated, TypedDict

import pytest
from support.documents import check_document, misfit, result_of

from emaviz.cli import COMMANDS, main
from emaviz.cli.ending import ExitCode
from emaviz.cli.parser import parser_of, whole_parser
from emaviz.cli.verbs.schema import schema_of, verbs_with_documents

VERBS = verbs_with_documents()


def helps(parser, name="") -> dict[str, str]:
    """Of each command the text of --help."""
    found = {name: parser.format_help()} if name else {}
    for action in parser._subparsers._group_actions if parser._subparsers else ():
        for inner, one in action.choices.items():
            found |= helps(one, f"{name} {inner}".strip())
    return found


HELPS = helps(whole_parser())


def test_every_command_with_json_states_what_it_holds():
    assert {name for name, told in HELPS.items() if "--json FILE.json" in told} == set(VERBS)
    assert len(VERBS) >= 12


@pytest.mark.parametrize("verb", VERBS)
def test_every_field_says_what_it_is(verb):
    schema = schema_of(verb, VERBS[verb])
    assert schema["$defs"]["HeadJson"]["required"] == ["configuration", "schema", "seed", "versions"]
    for name, kind in schema["$defs"].items():
        assert kind["type"] == "object" and kind["description"], name
        silent = [field for field, one in kind["properties"].items() if not one.get("description")]
        assert not silent, f"{name}: {silent}"
    for reference in set(json.dumps(schema).split('"$ref": "')[1:]):
        assert reference.split('"')[0].removeprefix("#/$defs/") in schema["$defs"]


def test_the_schema_is_printed(capsys):
    assert main(["schema", "compare"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["title"] == "emaviz compare --json"
    region = printed["$defs"]["Region"]["properties"]
    assert {"from", "to", "rmse"} <= region.keys() and "unit" in region["rmse"]["description"]
    assert main(["schema", "actuator", "check"]) == 0
    assert "CheckedActuatorJson" in capsys.readouterr().out
    assert main(["schema"]) == 0
    assert [line.split("  ")[0] for line in capsys.readouterr().out.splitlines()] == list(VERBS)
    assert main(["schema", "view"]) == 2
    assert "no command with --json" in capsys.readouterr().err
    assert main(["schema", "actuator", "chek"]) == 2
    assert capsys.readouterr().err.endswith("; did you mean 'actuator check'?\n")


@pytest.mark.parametrize("name", sorted(HELPS))
def test_help_ends_with_the_exit_codes_and_where_the_fields_are(name):
    told = " ".join(HELPS[name].rpartition("\n\n")[2].split())
    failed = "1 an internal failure, or a standard output that cannot be written"
    codes = f"exit codes: 0 done; {failed}; 2 the input or the arguments are wrong; 130 interrupted"
    assert told == (f"{codes}. Fields of --json: emaviz schema {name}" if name in VERBS else codes)


def test_the_program_ends_with_the_codes_that_help_tells(monkeypatch, capsys):
    assert main(["effects"]) == ExitCode.DONE == 0
    assert main(["effects", "nothing"]) == ExitCode.WRONG_INPUT == 2

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("emaviz.cli.verbs.effects.run", interrupted)
    assert main(["effects"]) == ExitCode.INTERRUPTED == 130
    assert "gui" in COMMANDS and "exit codes: 0 done" in parser_of("").format_help()
    capsys.readouterr()


SHORT = {  # those whose results no other test reads
    "effects": [["effects"], ["effects", "cogging_torque"], ["effects", "torque_curve"]],
    "actuator new": [["actuator", "new", "a.toml", "--controller", "unknown"]],
    "actuator keys": [["actuator", "keys"]],
}


@pytest.mark.parametrize("verb", SHORT)
def test_short_results_are_as_stated(verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for arguments in SHORT[verb]:
        assert main([*arguments, "--json", "r.json"]) == 0
        assert result_of("r.json", verb)["configuration"]["json"] == "r.json"
    capsys.readouterr()


class Inner(TypedDict):
    """One number."""

    value: float


class Outer(TypedDict):
    """Several."""

    inner: Annotated[list[Inner], "all"]


def test_a_field_that_is_not_stated_is_found():
    head = {"schema": 1, "versions": dict.fromkeys(("emaviz", "numpy", "numba"), "1"), "seed": 0, "configuration": {}}
    check_document({**head, "inner": [{"value": 1}]}, (Outer,))
    for wrong in ({"inner": [{"value": 1.0, "more": 2}]}, {"inner": []} | {"more": 1}, {"inner": [{"value": "1"}]}, {}):
        assert misfit(wrong, Outer)
        with pytest.raises(AssertionError):
            check_document({**head, **wrong}, (Outer,))

"""What every verb says and writes on fixed inputs, beside what it said and wrote when that was last looked at.

`EMAVIZ_GOLDEN=write pytest -m "not study" tests/golden` writes the files in `expected` anew: read their diff before it
is committed.  Text stands there with its numbers masked, since processors differ in the last digits; the numbers are
in the JSON, held to 1e-6, or to what an iterative result is good for.
"""

from __future__ import annotations

import html
import json
import math
import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader
from support.bench_units import ACTUATOR, write_units
from support.cheap_plans import cheap
from support.flexible_drive import flexible_drive

from ema_model.recordings import Measurement, write_measurement
from emaviz.cli import main

EXPECTED = Path(__file__).parent / "expected"
REWRITE = os.environ.get("EMAVIZ_GOLDEN") == "write"
EXACT = 1e-6
# Of what a fit ends at, which stops within a part of its own interval.
FITTED = 2e-2

HASH = r"\b(?=[0-9a-f]*\d)(?=\d*[a-f])[0-9a-f]{7,40}\b"
_PROGRESS = re.compile(r"(?m)^\[\d+:\d+:\d+\] .*\n")  # of a machine that is slow
NUMBER = re.compile(
    HASH + r"|(?<![A-Za-z_0-9])[+−-]?(?<![A-Za-z_])\d+(?:[.,]\d+)*(?:[eE][+−-]?\d+|·10[⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?"
)
# What is as good as nothing may change places, and hold any number.
RANKED = re.compile(r"(?:^ ?[A-Z][A-Za-z ()#-]+ #(?: #)?(?: < # %)?\n)+", re.MULTILINE)
NOTHING = 1e-3  # a probability
OF_CHANCE = ("settings", "predicted_drop", "refitted_drop", "probability", "tested")
LONGEST_LIST = 8  # longer ones are told by their length and their mean


@dataclass(frozen=True)
class Case:
    """A command line, run in the folder of inputs; `outputs` are files of it that are held, too."""

    name: str
    line: str
    exact: bool = True
    long: bool = False
    code: int = 0

    @property
    def written(self) -> list[str]:
        """What its options write, by the suffixes that are looked into."""
        words = shlex.split(self.line)
        named = [words[i + 1] for i, word in enumerate(words[:-1]) if word in OUTPUTS]
        return [name for name in named if Path(name).suffix in HELD]


OUTPUTS = ("--json", "--report", "--record", "--out", "--save-actuator")
ALL = "--json {0}.json --report {0}.html --record {0}.rrd"

CASES = (
    Case("simulate", "simulate --fault k1=0.25 --duration 0.02 --noise-current 0.1 --out s.csv --json s.json"),
    Case("simulate_mm", "simulate --model mm --command step --duration 0.02 --out m.csv --record m.rrd"),
    Case(
        "identify",
        "identify chirp.csv --algorithm do --population 4 --iterations 2 " + ALL.format("i"),
        exact=False,
    ),
    Case("identify_robust", "identify moves.csv " + ALL.format("r"), exact=False, long=True),
    Case("compare", "compare push.csv --actuator bench.toml " + ALL.format("c"), exact=False),
    Case("compare_plain", "compare chirp.csv --no-calibrate " + ALL.format("p"), exact=False, long=True),
    Case(
        "compare_held_out",
        "compare left --holdout '*unseen*' --actuator bench.toml --json h.json",
        exact=False,
        long=True,
    ),
    Case("compare_closed", "compare moves.csv --save-actuator found.toml " + ALL.format("o"), exact=False, long=True),
    Case(
        "compare_units",
        "compare bench --by unit --actuator bench.toml --json u.json --report u.html",
        exact=False,
        long=True,
    ),
    Case("discover", "discover push.csv --actuator bench.toml --max-effects 1 " + ALL.format("d"), exact=False),
    Case("discover_closed", "discover moves.csv --max-effects 1 " + ALL.format("e"), exact=False, long=True),
    Case(
        "discover_units",
        "discover bench --by unit --actuator bench.toml --json v.json --report v.html",
        exact=False,
        long=True,
    ),
    Case("frequency", "frequency sweep.csv --actuator bench.toml " + ALL.format("q"), exact=False),
    Case("frequency_step", "frequency jump.csv --actuator bench.toml --json j.json"),
    Case("effects", "effects"),
    Case("effect", "effects cogging_torque --json f.json"),
    Case("own_effect", "effects user_torque"),
    Case("actuator_new", "actuator new n.toml --controller cascade --drive hysteresis --set motor.inertia_kgm2=1e-4"),
    Case("actuator_check", "actuator check bench.toml"),
    Case("challenges", "challenge"),
    Case("challenge", "challenge prototype"),
    Case("campaign", "campaign plan.toml --out runs --workers 1", exact=False),
    Case("campaign_status", "campaign status runs"),
    Case("campaign_report", "campaign report runs"),
    Case("refused_file", "compare none.csv", code=2),
    Case("refused_column", "compare chirp.csv --map time_s=t", code=2),
    Case("refused_option", "identify chirp.csv --algorithm swarm", code=2),
)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Recordings that are made by formula, not by a model, so that nothing but a verb's own change shows."""
    folder = tmp_path_factory.mktemp("inputs")
    before = Path.cwd()
    os.chdir(folder)
    write_units(folder / "bench")
    write_units(folder / "single")
    (folder / "single" / "left").rename(folder / "left")
    assert main(["actuator", "new", "bench.toml", "--name=bench", *ACTUATOR]) == 0
    write_measurement(_pushed(), folder / "push.csv")
    write_measurement(flexible_drive(3, 22.0), folder / "sweep.csv")
    write_measurement(_jumped(), folder / "jump.csv")
    run = "simulate --fault k1=0.3 --noise-current 0.1 --seed 3"
    assert main([*run.split(), "--duration=0.1", "--out=chirp.csv"]) == 0
    assert main([*run.split(), "--duration=0.5", "--out=moves.csv"]) == 0  # shows enough for a verdict to be firm
    cheap(folder, 3)
    yield folder
    os.chdir(before)


def _pushed() -> Measurement:
    """A motor of the bench with twelve cogs a turn, moved to and fro."""
    random = np.random.default_rng(5)
    time = np.arange(0.0, 3.0, 2e-3)
    position = 3.0 * np.sin(2.0 * np.pi * 0.7 * time) + 1.5 * np.sin(2.0 * np.pi * 1.9 * time)
    speed = np.gradient(position, time)
    torque = 1e-4 * np.gradient(speed, time) + 0.01 * np.sign(speed) + 0.003 * np.sin(12.0 * position + 0.4)
    current = torque / 0.05 + 0.01 * random.standard_normal(len(time))
    return Measurement({"time_s": time, "motor_position_rad": position, "current_A": current})


def _jumped() -> Measurement:
    """The same motor, pushed once."""
    time = np.arange(0.0, 3.0, 2e-3)
    current = np.where((time > 1.0) & (time < 1.2), 1.0, 0.0)
    speed = 500.0 * np.cumsum(current) * 2e-3
    return Measurement({"time_s": time, "motor_position_rad": np.cumsum(speed) * 2e-3, "current_A": current})


@pytest.mark.parametrize(
    "case", [pytest.param(one, id=one.name, marks=[pytest.mark.long] if one.long else []) for one in CASES]
)
def test_a_verb_says_and_writes_what_it_did(case, inputs, capsys, monkeypatch):
    monkeypatch.chdir(inputs)
    capsys.readouterr()
    assert main(shlex.split(case.line)) == case.code
    said = capsys.readouterr()
    _hold(case, "out", _masked(said.out, inputs))
    if not case.long:  # which may say how far it is
        _hold(case, "err", _masked(_PROGRESS.sub("", said.err), inputs))
    for name in case.written:
        _hold(case, Path(name).suffix[1:], HELD[Path(name).suffix](inputs / name, inputs))


def test_nothing_is_expected_that_no_verb_says():
    cases = {one.name for one in CASES}
    assert not [path.name for path in EXPECTED.iterdir() if path.name.partition(".")[0] not in cases]


def _hold(case: Case, kind: str, found: Any) -> None:
    """Compares with the expected file, or writes it."""
    path = EXPECTED / f"{case.name}.{kind}{'' if kind == 'json' else '.txt'}"
    if REWRITE:
        EXPECTED.mkdir(exist_ok=True)
        text = json.dumps(found, indent=1, ensure_ascii=False) + "\n" if kind == "json" else found
        if text.strip():
            path.write_text(text, encoding="utf-8")
        else:
            path.unlink(missing_ok=True)
        return
    expected = path.read_text(encoding="utf-8") if path.exists() else ""
    if kind == "json":
        differs = list(_differences(json.loads(expected), found, EXACT if case.exact else FITTED))
        assert not differs, f"{path.name}: " + "; ".join(differs[:8])
    else:
        assert found == expected, f"{path.name} reads otherwise"


# --- what is held of each kind of file --------------------------------------------------------------------------------


def _masked(text: str, folder: Path) -> str:
    """Numbers as #, spaces between columns as one: their widths follow the numbers."""
    text = NUMBER.sub("#", text.replace(str(folder), "…")).replace("#–", "–").replace("commit #+", "commit #")
    lines = "".join(f"{re.sub(r' +', ' ', line).rstrip()}\n" for line in text.split("\n")).rstrip("\n")
    return RANKED.sub(lambda rows: "".join(sorted(rows[0].splitlines(True))), f"{lines}\n") if lines.strip() else ""


def _json(path: Path, folder: Path) -> Any:
    document = json.loads(path.read_text(encoding="utf-8"))
    for varies in ("versions", "elapsed_s", "compile_s"):
        document.pop(varies, None)
    return _short(document, folder)


def _short(value: Any, folder: Path) -> Any:
    """Long lists by their length and mean, candidates by name (the last ones are as good as nothing), texts masked."""
    if isinstance(value, dict):
        if isinstance(value.get("candidates"), list):
            ranked = sorted(value["candidates"], key=lambda one: one["name"])
            value = {**value, "candidates": [_if_it_counts(one) for one in ranked]}
        return {_masked(key, folder).strip(): _short(one, folder) for key, one in value.items()}
    if isinstance(value, list):
        numbers = [one for one in value if isinstance(one, int | float)]
        if len(value) > LONGEST_LIST and len(numbers) == len(value):
            return {"length": len(value), "mean": math.fsum(numbers) / len(numbers)}
        return [_short(one, folder) for one in value[:LONGEST_LIST]] + [f"{len(value)} in all"]
    return _masked(value, folder).strip() if isinstance(value, str) else value


def _if_it_counts(candidate: dict[str, Any]) -> dict[str, Any]:
    if candidate.get("probability") is None or candidate["probability"] >= NOTHING:
        return candidate
    return {key: one for key, one in candidate.items() if key not in OF_CHANCE}


def _differences(expected: Any, found: Any, tolerance: float, where: str = "") -> Iterator[str]:
    if isinstance(expected, dict) and isinstance(found, dict):
        for key in expected.keys() | found.keys():
            if key not in expected or key not in found:
                yield f"{where}/{key} is {'new' if key in found else 'gone'}"
            else:
                yield from _differences(expected[key], found[key], tolerance, f"{where}/{key}")
    elif isinstance(expected, list) and isinstance(found, list) and len(expected) == len(found):
        for i, (one, other) in enumerate(zip(expected, found)):
            yield from _differences(one, other, tolerance, f"{where}/{i}")
    elif all(isinstance(one, int | float) and not isinstance(one, bool) for one in (expected, found)):
        if not math.isclose(expected, found, rel_tol=tolerance, abs_tol=1e-9):
            yield f"{where}: {expected} is now {found}"
    elif expected != found:
        yield f"{where}: {expected!r} is now {found!r}"


def _html(path: Path, folder: Path) -> str:
    """A report's text in reading order, then each figure's titles and traces."""
    text = path.read_text(encoding="utf-8")
    figures = json.loads(re.search(r'<script type="application/json" id="figures">(.*?)</script>', text, re.S)[1])
    body = re.sub(r"<(script|style|svg|math)\b.*?</\1>", " ", text, flags=re.S)
    body = re.sub(r"<footer>.*?</footer>", "", body, flags=re.S)
    body = re.sub(r"</?(section|h\d|p|div|tr|table|li|figure|nav|header)\b[^>]*>", "\n", body)
    lines = html.unescape(re.sub(r"<[^>]+>", " ", body)).split("\n")
    told = [" ".join(line.split()) for line in lines if line.strip()]
    return _masked("\n".join([*told, *map(_figure, figures["figures"])]), folder)


def _figure(figure: dict[str, Any]) -> str:
    layout = figure["layout"]
    axes = [f"{key} {layout[key].get('title', {}).get('text', '')}" for key in sorted(layout) if "axis" in key]
    traces = sorted({f"{one.get('type')} {one.get('name', '')}" for one in figure["data"]})
    return f"figure: {'; '.join(axes)} | {'; '.join(traces)}"


def _rrd(path: Path, folder: Path) -> str:
    """Entities with their components and timelines, and what the blueprint shows."""
    reader = RrdReader(path)
    held: dict[str, set[str]] = {}
    for chunk in reader.stream():
        lines = "static" if chunk.is_static else "+".join(sorted(set(chunk.timeline_names) - {"log_tick", "log_time"}))
        names = [name for name in chunk.to_record_batch().schema.names if ":" in name]
        held.setdefault(str(chunk.entity_path), set()).add(f"{lines}: {', '.join(sorted(names))}")
    told = [f"{entity} {' | '.join(sorted(parts))}" for entity, parts in sorted(held.items())]
    shown = set()
    for layout in reader.blueprints():
        for chunk in reader.stream(store=layout):
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if re.search("display_name|class_identifier|space_origin|query|container_kind", name):
                    shown.add(f"blueprint {name.split(':')[-1]}: {batch.column(name).to_pylist()[-1]}")
    return _masked("\n".join([*told, *sorted(shown)]), folder)


def _table(path: Path, folder: Path) -> str:
    """The columns of a recording that was written, and the rows' number as it is."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return f"{lines[0]}\n{len(lines) - 1} rows\n"


HELD = {
    ".json": _json,
    ".html": _html,
    ".rrd": _rrd,
    ".csv": _table,
    ".toml": lambda path, folder: _masked(path.read_text(encoding="utf-8"), folder),
}

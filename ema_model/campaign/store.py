"""The rows of a campaign on disk, and the campaign as a result: how far it is, what its rows say together, in words."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import secrets
import shutil
import subprocess
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, TypedDict

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.campaign.kinds import KINDS
from ema_model.campaign.task import COMMON, HOW, Task, from_json, text_hash
from ema_model.errors import InputError, quoted
from ema_model.files.opened import reason, refusal
from ema_model.files.written import FileLock, remove_abandoned, whole_file
from ema_model.result import Result
from ema_model.text import Document, Lines, Note, Table

# --- what results depend on besides their task: the sources, and the libraries that compute ---------------------------

_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")
_OF_A_RESULT = ("task.py", "benchmark.py", "kinds.py")  # of this folder; the rest only moves tasks and rows


@cache
def version() -> dict[str, str]:
    """By what: the package's version, a hash of its sources, the libraries' versions."""
    try:
        package = importlib.metadata.version("emaviz")
    except importlib.metadata.PackageNotFoundError:  # run from the sources without an installation
        package = "0+source"
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        inside = path.relative_to(_PACKAGE).as_posix()
        if not inside.startswith("campaign/") or inside.removeprefix("campaign/").startswith(_OF_A_RESULT):
            digest.update(inside.encode() + b"\0" + path.read_bytes() + b"\0")
    libraries = {name: importlib.metadata.version(name) for name in _LIBRARIES}
    return {"emaviz": package, "sources": digest.hexdigest()[:12], **libraries}


def differences(one: dict[str, str], other: dict[str, str]) -> str:
    """In what two versions differ: 'emaviz 0.1.0 / 0.2.0, numpy 2.4.6 / 2.5.0'; empty where they are the same."""
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    return ", ".join(f"{name} {one.get(name, 'none')} / {other.get(name, 'none')}" for name in names)


def commit() -> str:
    """The commit of the sources, with a + where they were changed since; empty where they are in no repository."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(_PACKAGE), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()

    try:
        return git("rev-parse", "--short=10", "HEAD") + ("+" if git("status", "--porcelain", ".") else "")
    except (OSError, subprocess.SubprocessError):
        return ""


# --- a campaign's folder: the plan, the actuators, and the rows so far, each file written whole or not at all ---------
# campaign.json      what is computed, with which version
# plan.toml          a copy of the plan
# actuators/*.toml   the files' texts, by hash
# parts/*.parquet    rows as they came, by kind: what is there is never computed again
# KIND.parquet       the table: all rows of a kind, sorted by name, once a run has ended

_SCHEMA = 1
_MOST_PARTS = 200  # small ones of a kind, before they are joined
_SMALL_BYTES = 2_000_000
_TRIES = 20  # to read parts that are being joined
_ENDING_S = 1.0  # in which a writer that was just killed may still be ending


class GroupJson(TypedDict):
    """How far one group of a plan is."""

    kind: Annotated[str, Meta(description="of its tasks: identify, compare, discover, …")]
    tasks: Annotated[int, Meta(description="how many there are")]
    rows: Annotated[int, Meta(description="how many are computed")]
    errors: Annotated[int, Meta(description="how many of those ended in an error")]


@dataclass(frozen=True)
class Header:
    """What a campaign's folder says of it."""

    title: str
    tasks: dict[str, int]  # by group
    kinds: dict[str, str]  # by group
    cases: dict[str, list[str]]  # by group, in the plan's order
    version: dict[str, str]
    about: str = ""
    commit: str = ""
    schema: int = _SCHEMA
    begun: str = field(default_factory=lambda: time.strftime("%Y-%m-%d %H:%M"))


@dataclass(frozen=True, eq=False)
class Packed:
    """A campaign's folder as a session has it."""

    header: Header
    plan: str
    actuators: dict[str, str]  # texts by hash
    rows: dict[str, NDArray[np.uint8]]  # by kind, as JSON


class Store:
    """The folder of one campaign, to read.  `writing` makes it the only writer."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """InputError where the folder holds no campaign."""
        self.folder = Path(folder)
        path = self.folder / "campaign.json"
        try:
            self.header = msgspec.json.decode(path.read_bytes(), type=Header)
        except (FileNotFoundError, NotADirectoryError):
            raise refusal(
                folder, "is no campaign's folder; name one that `emaviz campaign PLAN --out` has made"
            ) from None
        except (OSError, msgspec.DecodeError) as error:
            raise refusal(path, f"cannot be read ({reason(error)}); name a campaign's folder") from None
        if self.header.schema != _SCHEMA:
            raise refusal(path, f"schema {self.header.schema} is not known; this version reads schema {_SCHEMA}")
        self._lock: FileLock | None = None

    @classmethod
    def writing(cls, folder: str | os.PathLike[str], header: Header, plan: str, tasks: Sequence[Task]) -> Store:
        """The folder, made where it is missing, with this process as its only writer until `close`.

        InputError where it belongs to another version, to another plan (it holds rows that this one does not ask
        for), to another running process, or cannot be written.
        """
        at = Path(folder)
        try:
            if not (at / "campaign.json").exists():
                if at.exists() and (not at.is_dir() or any(at.iterdir())):
                    raise refusal(folder, "holds other files; name a folder that is empty or not there yet")
                (at / "parts").mkdir(parents=True, exist_ok=True)
                (at / "actuators").mkdir(exist_ok=True)
                _write(at / "campaign.json", msgspec.json.format(msgspec.json.encode(header)))
            store = cls(folder)
            store._own()
            try:
                store._check(tasks, header)
                for text in {task.actuator for task in tasks}:
                    _write(at / "actuators" / f"{text_hash(text)}.toml", text.encode())
                _write(at / "plan.toml", plan.encode())
                _write(at / "campaign.json", msgspec.json.format(msgspec.json.encode(header)))
            except BaseException:
                store.close()
                raise
        except OSError as error:
            raise _cannot_write(at, error) from None
        store.header = header
        return store

    def _own(self) -> None:
        self._lock = FileLock.acquire(self.folder / ".lock", _ENDING_S)
        if self._lock is None:
            raise refusal(self.folder, "another campaign is writing there; wait for its end, or name another folder")
        remove_abandoned(self.folder)
        remove_abandoned(self.folder / "parts")

    def _check(self, tasks: Sequence[Task], header: Header) -> None:
        if other := differences(self.header.version, header.version):
            raise refusal(
                self.folder,
                f"was made by another version ({other}); its rows stay as they are: name a new folder, or go back",
            )
        if strange := len(self.names(errors=True) - {task.name for task in tasks}):
            told = f"holds {strange} rows that this plan does not ask for; name another folder, or its own plan.toml"
            raise refusal(self.folder, told)

    def close(self) -> None:
        """Lets others write."""
        if self._lock is not None:
            self._lock.release()

    def append(self, kind: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keeps rows; InputError where the disk does not take them, and then none of them is kept."""
        schema = pa.schema([*KINDS[kind].schema, *HOW])
        filled = [{name: row.get(name) for name in schema.names} for row in rows]
        self._write_part(kind, pa.Table.from_pylist(filled, schema))
        parts = [part for part in self._parts(kind) if part.stat().st_size < _SMALL_BYTES]
        if len(parts) > _MOST_PARTS:
            self._write_part(kind, _read(parts, schema))  # a kill here leaves rows twice, which are the same
            for part in parts:
                part.unlink()

    def names(self, *, errors: bool) -> set[str]:
        """Names of the tasks that have a row; errors: also where that is an error."""
        found: set[str] = set()
        for kind in KINDS:
            rows = self._rows(kind, pa.schema([COMMON.field("name"), COMMON.field("error")]))
            pairs = zip(rows["name"].to_pylist(), rows["error"].to_pylist())
            found.update(name for name, error in pairs if errors or error is None)
        return found

    def table(self, kind: str, *, how: bool = False) -> pa.Table:
        """All rows of a kind, sorted by name; how: with what is another each time."""
        rows = self._rows(kind, pa.schema([*KINDS[kind].schema, *(HOW if how else ())]))
        # Of a task that was computed again, the answer goes before the error.
        keys = zip(
            rows["name"].to_pylist(), (error is not None for error in rows["error"].to_pylist()), range(len(rows))
        )
        best = {name: at for name, _, at in sorted(keys, reverse=True)}
        return rows.take(pa.array([best[name] for name in sorted(best)], pa.int64())).combine_chunks()

    def write_tables(self) -> list[Path]:
        """Writes the table of each kind that has rows; their paths.  InputError as `append`."""
        written = []
        for kind in KINDS:
            if self._parts(kind):
                written.append(self.folder / f"{kind}.parquet")
                self._write(written[-1], self.table(kind))
        return written

    def progress(self) -> dict[str, GroupJson]:
        """By group: its kind, how many tasks it has, how many have a row, how many of those are errors."""
        counts: dict[str, GroupJson] = {
            group: {"kind": kind, "tasks": self.header.tasks[group], "rows": 0, "errors": 0}
            for group, kind in self.header.kinds.items()
        }
        for kind in set(self.header.kinds.values()):
            rows = self.table(kind)
            for group, error in zip(rows["group"].to_pylist(), rows["error"].to_pylist()):
                counts[group]["rows"] += 1
                counts[group]["errors"] += error is not None
        return counts

    def seconds(self) -> dict[str, float]:
        """By group, the mean time that its tasks took; groups without any are left out."""
        found: dict[str, float] = {}
        for kind in set(self.header.kinds.values()):
            means = self.table(kind, how=True).group_by("group").aggregate([("elapsed_s", "mean")])
            pairs = zip(means["group"].to_pylist(), means["elapsed_s_mean"].to_pylist())
            found |= {group: mean for group, mean in pairs if mean}
        return found

    def task(self, row: Mapping[str, Any]) -> Task:
        """The task of a table's row, to be computed again."""
        texts = {path.stem: path.read_text(encoding="utf-8") for path in (self.folder / "actuators").glob("*.toml")}
        try:
            return from_json(row["task"], texts)
        except KeyError as error:
            raise refusal(self.folder / "actuators", f"lacks the actuator {error} of this row") from None

    def packed(self) -> Packed:
        """All that the folder holds; InputError where it cannot be read."""
        try:
            files = sorted((self.folder / "actuators").glob("*.toml"))
            texts = {path.stem: path.read_text(encoding="utf-8") for path in files}
        except (OSError, UnicodeDecodeError) as error:
            raise refusal(self.folder, f"cannot be read ({reason(error)})") from None
        tables = {kind: self.table(kind, how=True).to_pylist() for kind in sorted(set(self.header.kinds.values()))}
        rows = {kind: np.frombuffer(json.dumps(one).encode(), np.uint8) for kind, one in tables.items() if one}
        return Packed(self.header, self.plan, texts, rows)

    @classmethod
    def unpacked(cls, folder: Path, packed: Packed) -> Store:
        """The same in a new folder; InputError, and nothing is left of it, for what makes no sense or is not kept."""
        try:
            rows = {kind: json.loads(one.tobytes()) for kind, one in packed.rows.items()}
            hashed = {name: text_hash(text) for name, text in packed.actuators.items()}
            if not {*rows, *packed.header.kinds.values()} <= {*KINDS} or any(a != b for a, b in hashed.items()):
                raise InputError("its rows are of no kind, or of other actuators")
            (folder / "parts").mkdir(parents=True)
            (folder / "actuators").mkdir()
            for name, text in packed.actuators.items():
                _write(folder / "actuators" / f"{name}.toml", text.encode())
            _write(folder / "plan.toml", packed.plan.encode())
            _write(folder / "campaign.json", msgspec.json.format(msgspec.json.encode(packed.header)))
            store = cls(folder)
            for kind, one in rows.items():
                store.append(kind, one)
            store.progress()  # which counts the rows of the groups that the header knows
        except (AttributeError, InputError, LookupError, OSError, RecursionError, TypeError, ValueError) as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise InputError(f"the session's campaign is damaged ({quoted(error, 100)}); save it anew") from None
        return store

    @property
    def plan(self) -> str:
        """The plan's text; InputError where it cannot be read."""
        try:
            return (self.folder / "plan.toml").read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise refusal(self.folder / "plan.toml", f"cannot be read ({reason(error)})") from None

    def _parts(self, kind: str) -> list[Path]:
        return sorted((self.folder / "parts").glob(f"{kind}-*.parquet"))

    def _rows(self, kind: str, schema: pa.Schema) -> pa.Table:
        """All rows that are there; who writes may join parts meanwhile."""
        for _ in range(_TRIES):
            try:
                return _read(self._parts(kind), schema)
            except FileNotFoundError:
                continue
        raise refusal(self.folder, "its parts go away while they are read; wait, and try again")

    def _write_part(self, kind: str, rows: pa.Table) -> None:
        name = f"{kind}-{time.time_ns():020d}-{secrets.token_hex(4)}.parquet"
        self._write(self.folder / "parts" / name, rows)

    def _write(self, path: Path, rows: pa.Table) -> None:
        try:
            with whole_file(path) as draft:
                pq.write_table(rows, draft)
        except OSError as error:
            raise _cannot_write(self.folder, error) from None


def _read(parts: Iterable[Path], schema: pa.Schema) -> pa.Table:
    """Rows of files; FileNotFoundError where one has gone."""
    tables = [schema.empty_table()]
    for part in parts:
        try:
            rows = pq.ParquetFile(part, memory_map=False).read(columns=schema.names)
        except FileNotFoundError:
            raise
        except (OSError, pa.ArrowException):
            raise refusal(part, "is damaged; remove it, and its tasks are computed again") from None
        if rows.schema.names != schema.names:
            raise refusal(part, "has other columns than this version writes; look at it with the one that made it")
        tables.append(rows)
    return pa.concat_tables(tables)


def header_of(title: str, about: str, tasks: Sequence[Task]) -> Header:
    """What the folder of these tasks says, as computed by this process's version."""
    counts: dict[str, int] = {}
    kinds: dict[str, str] = {}
    cases: dict[str, dict[str, None]] = {}
    for task in tasks:
        counts[task.group] = counts.get(task.group, 0) + 1
        kinds[task.group] = task.kind
        cases.setdefault(task.group, {})[task.case] = None
    ordered = {group: list(its) for group, its in cases.items()}
    return Header(title, counts, kinds, ordered, version(), about, commit())


def _cannot_write(folder: Path, error: OSError) -> InputError:
    """The line for a full disk and the like."""
    why = error.strerror or type(error).__name__
    return InputError(
        f"{quoted(folder)}: cannot be written ({why}); what is there is kept: free some room, and give the same command"
    )


def _write(path: Path, content: bytes) -> None:
    with whole_file(path) as draft:
        draft.write_bytes(content)


# --- what a campaign's rows say together ------------------------------------------------------------------------------
# What a campaign's rows say together: a table a kind, a line a group, and one a case where a group has several.


@dataclass(frozen=True)
class Summary:
    """The table of a kind's rows."""

    kind: str
    title: str
    heads: list[str]
    lines: list[list[str]]


def summaries(store: Store) -> list[Summary]:
    """The tables of the kinds that the campaign has rows of."""
    found = []
    for kind in sorted(set(store.header.kinds.values())):
        rows = store.table(kind).to_pylist()
        if rows:
            found.append(_summary(kind, store, rows))
    return found


def failed(store: Store) -> list[dict[str, Any]]:
    """The rows of tasks that ended in an error: group, case, seed, error, name."""
    names = ["group", "case", "seed", "error", "name"]
    rows = [row for kind in KINDS for row in store.table(kind).select(names).to_pylist()]
    return [row for row in rows if row["error"] is not None]


def _summary(kind: str, store: Store, rows: list[dict[str, Any]]) -> Summary:
    lines = []
    for group in (group for group, its in store.header.kinds.items() if its == kind):
        own = [row for row in rows if row["group"] == group]
        there = {row["case"] for row in own}
        cases = [case for case in store.header.cases[group] if case in there]
        if len(cases) > 1:
            lines.append((group, "all", own))
        lines += [(group, case, [row for row in own if row["case"] == case]) for case in cases]
    told = [(group, case, its, [row for row in its if row["error"] is None]) for group, case, its in lines]
    numbers = [KINDS[kind].told(whole) if whole else {} for *_, whole in told]
    heads = list(dict.fromkeys(head for one in numbers for head in one))
    return Summary(
        kind,
        KINDS[kind].title,
        ["group", "case", "tasks", "errors", *heads],
        [
            [group, case, str(len(its)), str(len(its) - len(whole)), *(str(one.get(head, "–")) for head in heads)]
            for (group, case, its, whole), one in zip(told, numbers)
        ],
    )


# --- a campaign as a result: how far it is, what its rows say together ------------------------------------------------

_MOST_ERRORS = 10


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(Result):
    """The rows of a campaign's folder, each read once."""

    store: Store

    @property
    def title(self) -> Annotated[str, Meta(description="of the plan")]:
        """As the plan has it."""
        return self.store.header.title

    @property
    def version(
        self,
    ) -> Annotated[dict[str, str], Meta(description="of emaviz, a hash of its sources, and of its libraries")]:
        """With which the rows were made."""
        return self.store.header.version

    @property
    def commit(self) -> Annotated[str, Meta(description="of its source; empty where that is not known")]:
        """As the header has it."""
        return self.store.header.commit

    @property
    def groups(self) -> Annotated[dict[str, GroupJson], Meta(description="by name")]:
        """How far each is."""
        return self.progress

    @cached_property
    def progress(self) -> dict[str, GroupJson]:
        """The same, counted once."""
        return self.store.progress()

    @cached_property
    def by_kind(self) -> dict[str, list[dict[str, Any]]]:
        """All rows, with how each came about, by the kind of task."""
        return {kind: self.store.table(kind, how=True).to_pylist() for kind in set(self.store.header.kinds.values())}

    def answers(self, kind: str) -> list[dict[str, Any]]:
        """The rows of a kind that are no errors."""
        return [row for row in self.by_kind.get(kind, []) if row["error"] is None]

    def grouped(self, kind: str) -> dict[str, list[dict[str, Any]]]:
        """The same by group."""
        groups = dict.fromkeys(row["group"] for row in self.answers(kind))
        return {group: [row for row in self.answers(kind) if row["group"] == group] for group in groups}

    def of_known_truth(self, least: int = 1) -> dict[str, list[dict[str, Any]]]:
        """Identifications by group, of groups with so many or more."""
        known = {
            group: [row for row in rows if row["k_true"] is not None]
            for group, rows in self.grouped("identify").items()
        }
        return {group: rows for group, rows in known.items() if len(rows) >= least}

    @property
    def how_far(self) -> str:
        """'done', or '12 of 40 tasks have a row'."""
        rows, tasks = self.computed
        return "done" if rows == tasks else f"{rows} of {tasks} tasks have a row"

    @property
    def computed(self) -> tuple[int, int]:
        """Tasks that have a row, and all."""
        every = self.progress.values()
        return sum(one["rows"] for one in every), sum(one["tasks"] for one in every)


# --- in words, for a terminal, a page, a report, and as Markdown ------------------------------------------------------


def document_of(of: Campaign) -> Document:
    """How far it is, a table a kind of task, and how many errors there are."""
    tables = [_table(one.title, one.heads, one.lines) for one in summaries(of.store)]
    errors = sum(one["errors"] for one in of.progress.values())
    notes = [Note(f"{errors} tasks ended in an error.")] if errors else []
    told = Lines([f"{of.title}: {of.how_far}. Made with {made_with(of.store)}."])
    return Document([told, *notes, _table("", _PROGRESS, _counted(of)), *tables])


_PROGRESS = ("group", "does", "rows", "of", "errors")


def _counted(of: Campaign) -> list[list[str]]:
    """A line a group."""
    return [
        [group, one["kind"], *(str(one[what]) for what in ("rows", "tasks", "errors"))]
        for group, one in of.progress.items()
    ]


def _table(title: str, heads: Sequence[str], lines: Sequence[Sequence[str]]) -> Table:
    """Its first two columns, of text, as one."""
    rows = [[" · ".join(filter(None, line[:2])), *line[2:]] for line in lines]
    first = " · ".join(filter(None, heads[:2]))
    return Table(list(heads[2:]), rows, f"{title}: {first}" if title else first)


def made_with(store: Store) -> str:
    """'emaviz 0.1.0 (commit 1a2b3c), numpy 2.4.6, …; begun 2026-11-22 10:00'."""
    header = store.header
    versions = dict(header.version)
    own = f"emaviz {versions.pop('emaviz')} (commit {header.commit or 'none'}, sources {versions.pop('sources')})"
    return f"{', '.join([own, *(f'{name} {one}' for name, one in versions.items())])}; begun {header.begun}"


def progress_table(of: Campaign) -> str:
    """How far each group is."""
    lines = _counted(of)
    return f"{of.title}: {of.how_far}\n{made_with(of.store)}\n\n{_aligned([_PROGRESS, *lines])}"


def interrupted(store: Store) -> str:
    """What a campaign has that was interrupted."""
    rows, tasks = Campaign(store).computed
    return f"{store.folder}: interrupted, {rows} of {tasks} tasks have a row; the same line goes on from there"


def report_text(of: Campaign) -> str:
    """The tables in Markdown, with the version and the commit that they were made with."""
    store = of.store
    parts = [f"## {store.header.title}", *filter(None, [store.header.about]), f"Made with {made_with(store)}."]
    for one in summaries(store):
        parts += [f"### {one.title}", markdown_table(one.heads, one.lines)]
    if errors := failed(store):
        shown = [
            f"- {row['group']}, {row['case']}, seed {row['seed']}: {row['error']}" for row in errors[:_MOST_ERRORS]
        ]
        more = [f"- … {len(errors)} in all"] if len(errors) > _MOST_ERRORS else []
        parts += ["### Errors", "\n".join(shown + more)]
    return "\n\n".join(parts)


def markdown_table(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table as Markdown has it."""
    rows = [heads, ["---"] * len(heads), *lines]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(w) if i < 2 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths)))
        for row in rows
    )

"""Who may import whom: each folder only what stands below it, so that a fact is found by going down, never round.

The lists are the floors of a house from the ground up; folders of one floor do not know each other.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
FLOORS = {
    "ema_model": [
        ["child_processes", "errors", "kernel_cache", "members", "remembered", "text"],
        ["files", "quantities"],
        ["physics", "faults", "result"],
        ["effects", "kernels", "commands"],
        ["stacks", "actuator"],
        ["recordings", "side_by_side"],
        ["simulation"],
        ["models"],
        ["estimation", "exports"],
        ["identification", "comparison", "challenges", "analyses"],
        ["discovery", "tracking"],
        ["simulated_lives", "fleet"],
        ["simulated_fleets"],
        ["practice"],
        ["campaign"],
        ["api"],
    ],
    "ema_model.discovery": [
        ["thresholds"],
        ["loop", "transmission"],
        ["result"],
        ["evidence", "fingerprints", "refit", "remaining", "uncertainty"],
        ["curve", "next_experiment", "terms", "words"],
        ["history"],
        ["objections", "rounds"],
        ["inverse"],
        ["search"],
        ["discover", "snapshot"],
    ],
    "emaviz": [
        ["colours", "text"],
        ["recording"],
        ["figures", "formats"],
        ["views"],
        ["session"],
        ["server"],
        ["scene"],
        ["page"],
        ["cli"],
        ["__main__"],
    ],
}
FORBIDDEN = {  # what else a package must not know
    "ema_model": ("emaviz", "viser", "rerun", "plotly"),
}


def modules(package: str) -> dict[str, Path]:
    """Every module of a package by its dotted name."""
    found = {}
    for path in PROJECT.joinpath(*package.split(".")).rglob("*.py"):
        parts = path.relative_to(PROJECT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def _imports_of(path: Path) -> list[ast.Import | ast.ImportFrom]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(path: Path, known: dict[str, Path]) -> Iterator[tuple[int, str]]:
    """Line and module of everything that a file imports, inside functions and for types too."""
    for node in _imports_of(path):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        else:
            folder = ".".join(path.relative_to(PROJECT).parts[: -node.level]) if node.level else ""
            module = ".".join(filter(None, (folder, node.module)))
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield node.lineno, inner if inner in known else module


def room(module: str, package: str) -> str:
    """The folder, or the loose file, of a package that a module stands in; "" outside of it."""
    inside = module.removeprefix(f"{package}.")
    return inside.split(".")[0] if inside != module else ""


@pytest.mark.parametrize("package", FLOORS)
def test_each_room_stands_on_a_floor(package: str) -> None:
    rooms = {room(name, package) for name in modules(package)} - {""}
    assert rooms == {one for floor in FLOORS[package] for one in floor}


@pytest.mark.parametrize("package", FLOORS)
def test_no_room_imports_what_stands_beside_or_above_it(package: str) -> None:
    floor_of = {one: level for level, floor in enumerate(FLOORS[package]) for one in floor}
    known = modules(package)
    wrong = []
    for name, path in known.items():
        here = room(name, package)
        for line, module in imports(path, known):
            there = room(module, package)
            if not there or not here or there == here:
                continue
            if floor_of[there] >= floor_of[here]:
                wrong.append(f"{path.relative_to(PROJECT)}:{line} imports {module}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", FORBIDDEN)
def test_the_science_knows_no_screen(package: str) -> None:
    known = modules(package)
    wrong = [
        f"{path.relative_to(PROJECT)}:{line} imports {module}"
        for path in known.values()
        for line, module in imports(path, known)
        if module.split(".")[0] in FORBIDDEN[package]
    ]
    assert not wrong, "\n".join(wrong)


def test_no_file_is_in_a_circle() -> None:
    known = modules("ema_model") | modules("emaviz")
    needs = {
        name: {module for _, module in imports(path, known) if module in known and module != name}
        for name, path in known.items()
        if path.name != "__init__.py"  # a package's face hands on the names of its own files
    }
    found = circle(needs)
    assert not found, f"these import each other in a loop: {' -> '.join(found)}"


def circle(needs: dict[str, set[str]]) -> list[str]:
    """One loop of a graph, its first node again at the end; empty where there is none."""
    needs = dict(needs)
    while leaves := [name for name, needed in needs.items() if not needed & needs.keys()]:
        for name in leaves:
            del needs[name]
    path = list(needs)[:1]
    while path and path[-1] not in path[:-1]:
        path.append(min(needs[path[-1]] & needs.keys()))
    return path[path.index(path[-1]) :] if path else []


def test_a_circle_is_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == ["b", "c", "b"]
    assert circle({"a": {"b"}, "b": set()}) == []

"""What all tests share: how many processes they take, and the browser."""

from __future__ import annotations

import gc
import os
import shutil
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings
from support.browser import Browser

# Files that begin: by one process, what most kernels are compiled for; by the other, what needs none meanwhile.
FIRST = ("test_discover.py", "test_bombs.py", "test_saved_model.py", "test_damaged_files.py")
LONGEST = ("real_data", "units", "discovery")  # folders

# As `emaviz` says it, before any test imports numpy: two processes' threads would wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Tests take what a first use takes; what is compiled behind it, they would wait for elsewhere.
os.environ["EMAVIZ_COMPILE_AHEAD"] = "0"
# Programs that tests start begin as installed ones do: with their modules compiled, whatever this shell says of that.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# An example's time is the machine's: the first one compiles what it calls, and others wait for a busy core.
settings.register_profile("any time", deadline=None)
settings.load_profile("any time")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """The whole suite takes two processes or more; chosen tests, a study, or `-s` run here."""
    whole = config.args_source == pytest.Config.ArgsSource.TESTPATHS
    if not whole or config.option.capture == "no" or "not study" not in config.option.markexpr:
        return 0
    return min(4, os.cpu_count() or 1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that take a minute begin first: a process that is given one last would keep the other waiting."""

    def turn(item: pytest.Item) -> int:
        if item.path.name in FIRST:
            return FIRST.index(item.path.name)
        return len(FIRST) + (item.path.parent.name not in LONGEST)

    items.sort(key=turn)


def pytest_collection_finish() -> None:
    """All tests of a process live as long as it: looking through them for waste again and again takes a twentieth."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def no_page_errors(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test fails by an error in the console of any page of it, unless it is of those that ask for one."""
    yield
    if "browser" in request.fixturenames:
        errors = request.getfixturevalue("browser").errors()
        assert request.node.get_closest_marker("page_errors") or not errors, "\n".join(errors)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Headless Chromium; without one the test is skipped, in CI it fails."""
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        message = "no Chromium found: install Debian's chromium, or name one in EMAVIZ_CHROMIUM"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = Browser(playwright, path)
        yield chromium
        chromium.close()

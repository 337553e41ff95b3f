"""Foreign text on the page is text: escaped into templates, wherever it is shown, and nothing goes round that."""

from __future__ import annotations

import ast
import html as markup
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from support import hostile
from support.on_page import wait_until

import emaviz
from emaviz.figures import discovery, runs, theme
from emaviz.page.app import App
from emaviz.page.discover import DiscoverTab
from emaviz.page.explore import ExploreTab
from emaviz.page.runs import _card
from emaviz.session.files import RecordedRuns, recovered
from emaviz.text.html import Html, html, html_escape, joined, said

RAW = ("<iframe srcdoc", "<img", "<script", 'href="javascript')


@pytest.mark.parametrize("name", hostile.NAMES)
def test_values_are_escaped_and_templates_are_not(name):
    safe = markup.escape(name)
    assert (
        html("<b title='{}'>{}</b>{:.1f}{}", name, name, 1.25, Html("<br>")) == f"<b title='{safe}'>{safe}</b>1.2<br>"
    )
    assert joined([name, Html("<i>a</i>"), name], "<br>") == f"{safe}<br><i>a</i><br>{safe}"
    assert Html("<b>") + name == f"<b>{safe}" and name + Html("<b>") == f"{safe}<b>"
    assert isinstance(name + Html("<b>"), Html) and html_escape(html_escape(name)) == safe, "once"
    assert markup.unescape(said(name)).count(name) == 1
    assert html("{0!r} {named}", name, named=name) == f"{markup.escape(repr(name))} {safe}"
    assert html("{:>60}", Html("<b>")) == markup.escape(f"{'<b>':>60}"), "what is formatted is text again"


def test_the_page_gets_html_and_markdown_in_no_other_way():
    """Markdown is for literals that are never written anew; all other pieces come from text.html."""
    wrong = []
    for path in Path(emaviz.__file__).parent.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        plain = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            name = node.func.attr if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) else ""
            if name == "add_html" and path.name != "html.py":
                wrong.append(f"{path.name}:{node.lineno}: add_html of viser; take text.html's")
            if name == "add_markdown":
                (text,) = node.args
                ours = isinstance(text, ast.Constant) or (isinstance(text, ast.Name) and text.id.isupper())
                if id(node) not in plain or not ours:
                    wrong.append(f"{path.name}:{node.lineno}: Markdown that is no literal; take text.html's add_html")
    assert not wrong


@pytest.mark.parametrize("name", hostile.NAMES)
def test_figures_take_no_name_for_a_tag(name):
    figure, empty = theme.new(name, name, name).layout, theme.missing(name, name).layout
    texts = [figure.title.text, figure.xaxis.title.text, figure.yaxis.title.text, empty.annotations[0].text]
    texts.append(discovery._legend(SimpleNamespace(name=name)))
    assert all(markup.escape(name, quote=False) in text for text in texts)


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    data = hostile.folder(tmp_path_factory.mktemp("data"))
    lines = recovered(data.recordings)
    assert len(lines) == 2
    app = App("127.0.0.1", 0, data.folder)
    assert app.wait_for_first_picture(120.0)
    wait_until(lambda: "Ready" in app.tab(ExploreTab).panel.status.content)  # the last that it says of its own accord
    app.lines = lines
    yield app
    app.close()


def on_the_page(app, prop="content"):
    """All HTML of the page, or all `_markdown`, as it goes to the browser."""
    handles = [one for box in app.server.gui._container_handle_from_uuid.values() for one in box._children.values()]
    return [getattr(one._impl.props, prop, "") for one in handles if hasattr(one, "_impl")]


def seen(app, name):
    return any(name in markup.unescape(text) for text in on_the_page(app))


def check(app, *names):
    """All of the names are seen, and nothing of them is markup."""
    wait_until(lambda: all(seen(app, name) for name in names), 20.0)
    check_nothing_is_markup(app)


def check_nothing_is_markup(app):
    assert {type(text) for text in on_the_page(app)} == {str}, "viser can send no other"
    assert not [text for text in on_the_page(app) if any(sign in text for sign in RAW)]
    assert not [text for text in on_the_page(app, "_markdown") if any(name in text for name in hostile.NAMES)]


def check_end(app, job, line):
    """As `check`, of a job's last line; told again where a comparison that the page began itself spoke after it."""

    def told():
        job.ended(line)
        time.sleep(0.1)
        return seen(app, line)

    wait_until(told, 60.0)
    check_nothing_is_markup(app)


def test_what_explore_says_of_recovered_recordings(app):
    for line in app.lines:
        app.session.events.status(line)
        check(app, line)


@pytest.mark.parametrize("name", hostile.NAMES)
def test_recordings_on_compare_and_what_is_said_of_them(app, name):
    for kind in ("", "columns "):
        app.comparing.add(f"uploads/{kind}{name}.csv")
        wait_until(lambda kind=kind: f"uploads/{kind}{name}.csv" in app.comparing.opened)
        check(app, f"{kind}{name}.csv")
    check(app, f"{name} of a column")
    check_end(app, app.comparing.job, f"{name}.csv: line 1, column {name}: is wrong")
    check_end(app, app.discovering.job, f"{name}.csv: cannot be used")
    for kind in ("", "columns "):
        app.comparing.remove(f"uploads/{kind}{name}.csv")


def test_the_story_of_a_challenge(app):
    app.tab(DiscoverTab).panel.source.uploaded(app.comparing.folder.challenges / f"{hostile.IMAGE}.challenge")
    check(app, f"{hostile.IMAGE}.", f"{hostile.FRAME} {hostile.MARKDOWN}")


def test_recordings_and_what_they_say_of_themselves(app):
    check(app, *(f"{name}.rrd" for name in hostile.NAMES), f"whole {hostile.FRAME}.rrd")
    recorded = RecordedRuns(app.comparing.folder.recordings)
    first, second = (recorded.entry(f"{name}.rrd") for name in hostile.NAMES[:2])
    assert first.settings[hostile.FRAME] == hostile.FRAME and first.best == hostile.FRAME
    for text in (runs.two_recordings_table(first, second), _card(first), _card(second)):
        assert isinstance(text, Html) and not any(sign in text for sign in RAW)

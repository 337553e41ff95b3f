"""What tests of the page do again and again: wait, and find, fill and choose in its controls."""

import contextlib
import time

from playwright.sync_api import Error


def wait_until(condition, seconds=240.0):
    """Of a loaded machine that compiles, too; only a failure waits that long."""
    end, pause_s = time.monotonic() + seconds, 0.02
    while not condition():
        assert time.monotonic() < end
        time.sleep(pause_s)
        pause_s = min(1.3 * pause_s, 0.1)  # to ask a page takes milliseconds of its core and of ours


def wait_until_at_rest(page, told):
    """Until what the page tells of a chart is there and stays: a chart moves as what stands around it is drawn."""
    seen = [None]

    def rests():
        page.wait_for_timeout(250)
        seen.append(page.evaluate(told))
        return seen[-1] is not None and seen[-1] == seen[-2]

    wait_until(lambda: page.evaluate("!!window.emavizMeasure"))  # a new page has its charts before its scripts
    wait_until(rests, 60.0)


def field(page, label):
    """The input beside a label."""
    row = page.locator(f'xpath=//label[normalize-space(.)="{label}"]').locator(
        "xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]"
    )
    return row.locator("input:not([type=hidden])").first


def fill(page, label, value):
    field(page, label).fill(str(value))
    field(page, label).press("Enter")


def press(page, name, leads_to):
    """A button, pressed again where the page has drawn it anew at that moment; leads_to: what is seen then."""
    for _ in range(3):
        page.get_by_role("button", name=name).click()
        with contextlib.suppress(Error):
            return leads_to.wait_for(timeout=15_000)
    raise AssertionError(f"{name} does not lead on")


def choose(page, label, option):
    """Opens the list again where the page has drawn it anew meanwhile."""
    wanted = page.get_by_role("option", name=option, exact=True)
    for _ in range(5):
        page.get_by_label(label, exact=True).click()
        with contextlib.suppress(Error):
            return wanted.click(timeout=4_000)
        page.keyboard.press("Escape")
    raise AssertionError(f"{label} does not offer {option}")

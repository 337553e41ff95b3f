"""What tests of the page do again and again: wait, and find, fill and choose in its controls."""

import time


def wait_until(condition, seconds=240.0):
    """Of a loaded machine that compiles, too; only a failure waits that long."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def field(page, label):
    """The input beside a label."""
    row = page.locator(f'xpath=//label[normalize-space(.)="{label}"]').locator(
        "xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]"
    )
    return row.locator("input:not([type=hidden])").first


def fill(page, label, value):
    field(page, label).fill(str(value))
    field(page, label).press("Enter")


def choose(page, label, option):
    page.get_by_label(label, exact=True).click()
    page.get_by_role("option", name=option, exact=True).click()

"""A browser without a screen: Debian's chromium, or playwright's own where somebody has fetched it."""

import contextlib
import os
import shutil
from pathlib import Path

from needed import lacking, needed

SHOTS = Path(__file__).parents[1] / "screenshots"
"""Where pictures of pages are kept; git ignores it."""
SIZES = {"desktop": (1280, 900, "light"), "dark": (1280, 900, "dark"), "phone": (390, 844, "light")}


@contextlib.contextmanager
def browser():
    """A browser that has been started, or a skip that says what is missing."""
    api = needed("playwright.sync_api", "playwright is not installed")
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    with api.sync_playwright() as playwright:
        path = found or playwright.chromium.executable_path
        if not os.path.exists(path):
            lacking("no chromium: `apt-get install chromium`, or `playwright install chromium`")
        started = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        try:
            yield started
        finally:
            started.close()


@contextlib.contextmanager
def opened(started, path, size):
    """A page, with what its console said."""
    width, height, scheme = SIZES[size]
    context = started.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    page, said = context.new_page(), []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request", lambda request: said.append(request.url) if not request.url.startswith("file:") else None
    )
    page.goto(Path(path).as_uri())
    try:
        yield page, said
    finally:
        context.close()


def kept(page, name):
    """A picture of the whole page."""
    SHOTS.mkdir(exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png", full_page=True)


def serious(page):
    """What axe finds that keeps people out, in words."""
    axe = needed("axe_playwright_python.sync_playwright", "axe is not installed")
    found = axe.Axe().run(page).response["violations"]
    return [
        f"{each['id']}: {each['help']} ({each['nodes'][0]['html'][:160]})"
        for each in found
        if each["impact"] in ("serious", "critical")
    ]

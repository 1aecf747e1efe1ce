"""Makes the pictures of the documentation by the commands beside them: `.venv/bin/python scripts/pictures.py`.

`--stale` makes nothing: it exits with 1 where the sources of the pages changed since the pictures were made. It needs
chromium and the packages of the extra `test`.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
MADE = PICTURES / "made.json"
SOURCES = ("python/twinloop/faces/report", "python/twinloop/faces/figures", "python/twinloop/faces/templates",
           "python/twinloop/faces/dashboard", "python/twinloop/faces/certificate.py")  # fmt: skip
MAPPING = """
[autopilot]
kind = "px4"
[autopilot.parameters]
"roll.kp" = "MC_ROLLRATE_P"
"roll.ki" = "MC_ROLLRATE_I"
"roll.kd" = "MC_ROLLRATE_D"
"pitch.kp" = "MC_PITCHRATE_P"
"pitch.ki" = "MC_PITCHRATE_I"
"pitch.kd" = "MC_PITCHRATE_D"
"yaw.kp" = "MC_YAWRATE_P"
"yaw.ki" = "MC_YAWRATE_I"
"yaw.kd" = "MC_YAWRATE_D"
"""
COMMANDS = (
    "run quadrotor --noise 0.001 --experiments 4 --store hover.db --name hover",
    "report hover.db -o hover.html",
    "certify hover.db -o hover --mapping px4.toml",
    "run quadrotor --noise 0.001 --experiments 2 --seed 1 --store second.db --name second",
    "compare hover.db second.db -o both.html",
    "ask hover.db",
    "dashboard hover.db",
)
"""What is typed; `report.md`, `export.md` and `dashboard.md` say the same."""
NOTEBOOK = """
import sys, twinloop as tl
campaign = tl.Campaign.load("hover.db", read_only=True)
cells = [campaign._repr_html_(), campaign.plot.step()._repr_svg_()]
open("notebook.html", "w", encoding="utf-8").write("<!doctype html><meta charset=utf-8>" + "<hr>".join(cells))
campaign.plot.unseen().save("unseen.svg")
"""
"""What two cells of a notebook give, the campaign and one of its figures; and the figure of the README."""
PAGES = {
    "report-good": ("hover.html", 1280, 900),
    "report-twin": ("hover.html#unseen", 1280, 1000),
    "report-controller": ("hover.html#controller", 1280, 1250),
    "report-campaign": ("hover.html#campaign", 1280, 1250),
    "report-phone": ("hover.html", 390, 844),
    "report-bad": ("end_stop.html", 1280, 900),
    "compare": ("both.html", 1280, 1000),
    "notebook": ("notebook.html", 1000, 800),
    "certificate": ("hover/certificate.html", 900, 1250),
    "dashboard": ("", 1280, 900),
    "dashboard-phone": ("", 390, 844),
}
"""The page of each picture with its place, and the size of its window; no page: the address of the dashboard."""


def main() -> int:
    """Makes the pictures, or says whether they are stale."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stale", action="store_true", help="only say whether the pages have changed since")
    if parser.parse_args().stale:
        known = json.loads(MADE.read_text()) if MADE.exists() else {}
        stale = known.get("sources") != digest()
        print(
            "The pages have changed since the pictures were made." if stale else "The pictures are of today."
        )
        return int(stale)
    with tempfile.TemporaryDirectory() as folder:
        room = Path(folder)
        (room / "px4.toml").write_text(MAPPING)
        for command in COMMANDS[:-2]:
            twinloop(room, command)
        subprocess.run([sys.executable, "-c", NOTEBOOK], cwd=room, check=True)
        twinloop(room, COMMANDS[-2])
        example = ROOT / "examples" / "end_stop.py"
        subprocess.run([sys.executable, example, "end_stop.html"], cwd=room, check=True)
        shutil.copy(room / "unseen.svg", PICTURES)
        take(room)
    MADE.write_text(json.dumps({"commands": COMMANDS, "sources": digest()}, indent=1) + "\n")
    return 0


def twinloop(room: Path, command: str) -> None:
    """Calls the command line in a folder."""
    subprocess.run([sys.executable, "-m", "twinloop", *command.split()], cwd=room, check=True)


def digest() -> str:
    """Of the sources that say what the pages look like."""
    found = hashlib.sha256()
    for source in SOURCES:
        at = ROOT / source
        files = sorted(at.rglob("*")) if at.is_dir() else [at]
        for file in files:
            if file.suffix in (".py", ".html", ".css", ".js"):
                found.update(file.read_bytes())
    return found.hexdigest()


def take(room: Path) -> None:
    """Pictures of the pages in a folder, and of the dashboard of its store."""
    from playwright.sync_api import sync_playwright

    from twinloop.faces.dashboard.command import prepared

    server, address = prepared(str(room / "hover.db"), 0)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        with sync_playwright() as playwright:
            path = shutil.which("chromium") or playwright.chromium.executable_path
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            for name, (file, width, height) in PAGES.items():
                page = browser.new_page(viewport={"width": width, "height": height})
                file, _, place = file.partition("#")
                page.goto((room / file).as_uri() + (place and f"#{place}") if file else address)
                page.wait_for_timeout(1500)
                page.screenshot(path=PICTURES / f"{name}.png")
            browser.close()
    finally:
        server.stop()
        thread.join(10.0)


if __name__ == "__main__":
    os.environ.setdefault("PYTHONPATH", str(ROOT / "python"))
    sys.exit(main())

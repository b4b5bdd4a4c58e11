"""The pictures in docs/images: which screenshot each is, and whether its page changed since.

``docs/images/sources.json`` holds, for each picture, a digest of the template and the style sheets
of its page as they were when it was taken. ``make pictures`` takes them; ``make check`` compares.
Comments, white space and scripts are not part of a digest: they seldom change what is seen.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
SOURCES = IMAGES / "sources.json"
COMMENT = re.compile(r"/\*.*?\*/|\{#.*?#\}|\{% comment %\}.*?\{% endcomment %\}", re.DOTALL)
USED = re.compile(r"\{% (?:extends|include) \"([^\"]+)\"|\{% static '(css/[^']+)' %\}")


class Picture(NamedTuple):
    """A picture's screenshot, and the template of the page on it."""

    screenshot: str
    template: str


PICTURES = {
    "start": Picture("start-laptop", "patients/start.html"),
    "patient-page": Picture("patient-laptop", "patients/start.html"),
    "set-up": Picture("set-up-laptop", "sessions/setup.html"),
    "report": Picture("report-laptop", "sessions/report.html"),
    "therapist": Picture("therapist-laptop", "sessions/monitor.html"),
    "past-sessions": Picture("past-sessions-laptop", "sessions/history.html"),
    "scores": Picture("scores-points-laptop", "boards/scores.html"),
    "caseload": Picture("demo-caseload-laptop", "patients/caseload.html"),
    "pairing": Picture("pairing-tablet-portrait", "sessions/tablet.html"),
    "leave": Picture("walk-leave-tablet-landscape", "sessions/walk.html"),
    "walking": Picture("walk-positive-hit-tablet-portrait", "sessions/walk.html"),
    "patient": Picture("walk-positive-hit-tablet-landscape", "sessions/walk.html"),
    "paused": Picture("walk-paused-tablet-portrait", "sessions/walk.html"),
    "largest": Picture("walk-side-largest-tablet-portrait", "sessions/walk.html"),
}


def files_of(template: str) -> Iterator[Path]:
    """Yield a template, what it extends and includes, and their style sheets, each once."""
    waiting, seen = [ROOT / "templates" / template], set()
    while waiting:
        file = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        yield file
        if file.suffix == ".html":
            for other, style in USED.findall(file.read_text()):
                waiting.append(ROOT / "templates" / other if other else ROOT / "static" / style)


def digest(template: str) -> str:
    """Return the digest of a template's files, without comments and white space."""
    texts = (COMMENT.sub("", file.read_text()) for file in sorted(files_of(template)))
    return hashlib.sha256("\0".join("".join(text.split()) for text in texts).encode()).hexdigest()


def outdated() -> list[str]:
    """Return the pictures whose page's template or style changed after they were taken."""
    stored = json.loads(SOURCES.read_text()) if SOURCES.exists() else {}
    return [
        name for name, picture in PICTURES.items() if stored.get(name) != digest(picture.template)
    ]


def take() -> None:
    """Take the screenshots of the pictures, copy them into docs/images and store the digests."""
    if shutil.which("pngquant") is None:
        sys.exit("Pictures are made smaller by pngquant. Cure: apt-get install pngquant")
    screenshots = {picture.screenshot for picture in PICTURES.values()}
    own = ("walk-", "demo-")  # what has a file of its own
    wanted = " or ".join(f"[{name}]" for name in screenshots if not name.startswith(own))
    for file, choice in (
        ("test_pictures.py", f"test_picture and ({wanted})"),
        ("test_walk_pictures.py", "test_pictures_of_a_walk"),
        ("test_demo_pictures.py", "laptop"),
    ):
        command = [sys.executable, "-m", "pytest", "-q", "-m", "screenshots", "-k", choice]
        subprocess.run([*command, f"tests/screenshots/{file}"], cwd=ROOT, check=True)
    smaller = ["pngquant", "96", "--force", "--speed", "1", "--strip", "--output"]
    for name, picture in PICTURES.items():
        screenshot = ROOT / f"screenshots/{picture.screenshot}.png"
        subprocess.run([*smaller, IMAGES / f"{name}.png", screenshot], check=True)
    stored = {name: digest(picture.template) for name, picture in PICTURES.items()}
    SOURCES.write_text(json.dumps(stored, indent=2) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description="Take the pictures that docs show, anew.")
    parser.add_argument("--check", action="store_true", help="only say which are out of date")
    if not parser.parse_args().check:
        take()
    elif names := outdated():
        sys.exit(
            f"The pages on these pictures changed after they were taken: {', '.join(names)}."
            " Cure: make pictures"
        )


if __name__ == "__main__":
    main()

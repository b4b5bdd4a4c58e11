"""Prepare a release: `make release VERSION=1.0.0`. It commits and tags, and publishes nothing."""

from __future__ import annotations

import gzip
import hashlib
import json
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from packaging.version import InvalidVersion, Version

from tests.support.servers import ROOT, run_python

RELEASES = (
    ROOT / "tests" / "deploy" / "releases"
)  # a database of each, which upgrades are tested on
SAMPLE = ["runsession", "--synthetic", "7", "--valence", "binary", "--strides", "100"]
BUILD = "import sys; from setuptools import build_meta as b; getattr(b, sys.argv[1])(sys.argv[2])"


def main(version: str) -> None:
    """Prepare a version. Raises SystemExit, with the cure."""
    check(version)
    today = datetime.now(UTC).date().isoformat()
    replace("pyproject.toml", r'^version = ".*"', f'version = "{version}"')
    replace("package.json", r'"version": ".*?"', f'"version": "{version}"')
    replace("CITATION.cff", r"^version: .*", f"version: {version}")
    replace("CITATION.cff", r"^date-released: .*", f"date-released: {today}")
    replace("CHANGELOG.md", r"^## Unreleased$", f"## Unreleased\n\n## {version}, {today}")
    if "Nothing was released yet. " in (ROOT / "CHANGELOG.md").read_text("utf-8"):
        replace("CHANGELOG.md", r"^Nothing was released yet\. ", "")
    subprocess.run(
        ["npm", "install", "--package-lock-only", "--ignore-scripts"], cwd=ROOT, check=True
    )
    RELEASES.mkdir(exist_ok=True)
    (RELEASES / f"{version}.sql.gz").write_bytes(database())
    run("git", "add", "--all")
    run("git", "commit", "--quiet", "--message", f"Release {version}")
    made = build(version)
    run("git", "tag", "--annotate", f"v{version}", "--message", f"GARRY {version}")
    print(f"{made} holds:", *sorted(file.name for file in made.iterdir()), sep="\n  ")
    print(f"Nothing is published. Look at it, then: git push --follow-tags, and upload {made}.")


def check(version: str) -> None:
    """Check that a version can be released here. Raises SystemExit, with the cure."""
    try:
        if str(Version(version)) != version:
            raise SystemExit(f"Write it as {Version(version)}.")
    except InvalidVersion:
        raise SystemExit(f"{version!r} is no version. Give VERSION=1.0.0 or 1.0.0rc1.") from None
    if run("git", "status", "--porcelain"):
        raise SystemExit("There are changes that no commit has. Commit them first.")
    if run("git", "tag", "--list", f"v{version}"):
        raise SystemExit(f"v{version} exists. Give a later version.")


def run(*command: str) -> str:
    """Run a command in the project; return what it prints."""
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout.strip()


def replace(name: str, pattern: str, text: str) -> None:
    """Replace the first match in a file. Raises SystemExit where there is none."""
    file = ROOT / name
    changed, count = re.subn(pattern, text, file.read_text("utf-8"), count=1, flags=re.MULTILINE)
    if not count:
        raise SystemExit(f"{name} has no line like {pattern}. Restore it, then try again.")
    file.write_text(changed, "utf-8")


def database() -> bytes:
    """Return the statements that make a database of this version, with one session."""
    with tempfile.TemporaryDirectory() as folder:
        run_python(Path(folder), "manage.py", "migrate", "--verbosity", "0")
        run_python(Path(folder), "manage.py", *SAMPLE, "--speed", "max")
        with sqlite3.connect(Path(folder, "garry.sqlite3")) as made:
            statements = "\n".join(made.iterdump())
    return gzip.compress(statements.encode(), mtime=0)


def build(version: str) -> Path:
    """Build what is published, its list of parts and checksums; return the folder."""
    made = ROOT / "dist" / version
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir(parents=True)
    for what in ("build_sdist", "build_wheel"):
        run(sys.executable, "-c", BUILD, what, str(made))
    run("make", "sbom")
    for part in (ROOT / "sbom").glob("*.json"):
        json.loads(part.read_text("utf-8"))
        shutil.copy(part, made / f"sbom-{part.name}")
    shutil.copy(ROOT / "deploy" / "Dockerfile", made)
    sums = [
        f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n"
        for file in sorted(made.iterdir())
    ]
    (made / "SHA256SUMS").write_text("".join(sums))
    return made


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) == 2 else "")

"""The ground that all else stands on: what may be committed, and what pure packages may need."""

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.servers import run_python

ROOT = Path(__file__).parent.parent

PACKAGE_ADDRESS = re.compile(
    r"https?://[^\s/\"']*(?:pypi|pythonhosted|npm|registry|mirror|deb\.)"  # by its host
    r"|https?://\S+(?:/simple\b|\.whl\b|\.tgz\b|\.tar\.gz\b)"  # by what lies there
    r"|(?:index-url|find-links|trusted-host|registry)\s*[= ]\s*\S*[/.]",  # by the option
    re.IGNORECASE,
)
MACHINE_PATH = re.compile(r"(?<![\w.])(?:/(?:root|work)/|/home/\w+/|/Users/\w+/|[A-Z]:\\Users)")


@pytest.fixture(scope="module")
def committable() -> list[Path]:
    """Every file that is in git, or would be after `git add --all`."""
    if not shutil.which("git") or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    files = [ROOT / name for name in listed.stdout.split("\0") if name]
    return [file for file in files if file.is_file()]


@pytest.mark.parametrize("pattern", [PACKAGE_ADDRESS, MACHINE_PATH], ids=["address", "path"])
def test_no_committable_file_is_bound_to_one_machine(
    committable: list[Path], pattern: re.Pattern[str]
) -> None:
    found = [
        f"{file.relative_to(ROOT)}:{number}: {line.strip()[:120]}"
        for file in committable
        if b"\0" not in (content := file.read_bytes())
        for number, line in enumerate(content.decode(errors="replace").splitlines(), 1)
        if pattern.search(line)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("pattern", "text"),
    [
        (PACKAGE_ADDRESS, "https:" + "//pypi.example.org/x"),
        (PACKAGE_ADDRESS, "https:" + "//example.org/pip/simple"),
        (PACKAGE_ADDRESS, "https:" + "//example.org/uplot.tgz"),
        (PACKAGE_ADDRESS, "--extra-index-" + "url http://127.0.0.1"),
        (MACHINE_PATH, "open('/" + "root/garry.sqlite3')"),
        (MACHINE_PATH, "cd /" + "home/ann/garry"),
    ],
    ids=["host", "index", "archive", "option", "root", "home"],
)
def test_patterns_find_what_they_are_for(pattern: re.Pattern[str], text: str) -> None:
    assert pattern.search(text)


def test_third_party_files_are_not_committed(committable: list[Path]) -> None:
    third_party = re.compile(r"node_modules|\.min\.|uplot|canvas-confetti", re.IGNORECASE)
    names = [file.relative_to(ROOT).as_posix() for file in committable]
    assert not [name for name in names if third_party.search(name)]


def test_constraints_are_exact_versions_only() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert len(pins) > 50
    assert not [pin for pin in pins if not re.fullmatch(r"[\w.-]+==[\w.]+", pin)]


@pytest.mark.parametrize("lock", sorted((ROOT / "locks").glob("*.txt")), ids=lambda lock: lock.stem)
def test_locks_have_hashes_of_the_same_versions_and_no_address(lock: Path) -> None:
    text = lock.read_text().replace(" \\\n", " ")
    pins = (ROOT / "constraints.txt").read_text()
    pinned = dict(re.findall(r"^([\w.-]+)==([\w.]+)", pins, re.MULTILINE))
    versions = {
        name.lower().replace("_", "-").replace(".", "-"): one for name, one in pinned.items()
    }
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines
    for line in lines:
        found = re.fullmatch(
            r"([\w-]+)==((?:\d+!)?[\w.]+)( ; [^#]+?)?( +--hash=sha256:\w{64})+", line
        )
        assert found, line[:80]
        # What other systems or Pythons need, and what builds GARRY, is not installed here.
        assert versions.get(found[1], found[2]) == found[2], line[:80]
    assert any(line.startswith("setuptools==") for line in lines)


def test_browser_libraries_are_exact_and_without_address() -> None:
    package = json.loads((ROOT / "package.json").read_text())
    lock = json.loads((ROOT / "package-lock.json").read_text())
    wanted = package["dependencies"] | package["devDependencies"]
    locked = {path: entry for path, entry in lock["packages"].items() if path}
    assert package["private"]
    assert (
        wanted.items()
        <= {
            path.removeprefix("node_modules/"): entry["version"] for path, entry in locked.items()
        }.items()
    )
    assert package["dependencies"].keys() == {
        path.removeprefix("node_modules/") for path, entry in locked.items() if "dev" not in entry
    }
    for entry in locked.values():
        assert entry.get("inBundle") or entry["integrity"].startswith("sha512-")
        assert "resolved" not in entry


def imported_by(file: Path) -> set[str]:
    """Return the modules that a file imports, and what it takes of them."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_no_test_imports_a_test() -> None:
    """What two of them need stands in tests/support, which imports no test either."""
    found = [
        f"{file.relative_to(ROOT)}: {name}"
        for file in sorted((ROOT / "tests").rglob("*.py"))
        for name in sorted(imported_by(file))
        if re.search(r"^tests\.(.*\.)?test_\w+(\.|$)", name)
    ]
    assert not found, "\n".join(found)


def test_test_files_are_short_and_named_without_their_folder() -> None:
    """A long file has two subjects; its folder has said whose tests these are."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    lengths = {file: len(file.read_text().splitlines()) for file in files}
    long = {file.name: lines for file, lines in lengths.items() if lines > 500}
    assert not long
    assert not [f for f in files if f.stem.startswith(f"test_{f.parent.name}_")]


# Clinic machines may run Windows and have no Django; what third-party libraries import is their
# own business, so they come first.
IMPORT_EVERYTHING = """
import contextlib, importlib, pkgutil, sys

for library in ("asyncio", "scipy.signal", "serial.tools.list_ports", "websockets.asyncio.client"):
    with contextlib.suppress(ImportError):
        importlib.import_module(library)
for name in ("django", "channels", "fcntl", "pty", "termios", "pybullet"):
    sys.modules[name] = None  # makes its import fail

package = importlib.import_module(sys.argv[1])
count = 1
for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
    importlib.import_module(module.name)
    count += 1
print(count)
"""


@pytest.mark.parametrize("package", ["rehab.gait", "rehab.sources", "rehab.training", "robot"])
@pytest.mark.server
def test_imports_without_django_posix_and_pybullet(package: str) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", IMPORT_EVERYTHING, package],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    files = len(list((ROOT / package.replace(".", "/")).rglob("*.py")))
    assert int(done.stdout) == files


# What few clinics need: extras, each loaded when it is asked for, and parts that only need us.
OPTIONAL = ("bleak", "cv2", "ezc3d", "mcap", "pyarrow", "pybullet", "pylsl", "serial")
SELDOM = ("rehab.legacy.importing", "robot.bases.avatar", "robot.homing", "rehab.sources.lsl")
SERVE = """
import sys
import garry_site.asgi
from django.urls import get_resolver

assert get_resolver().url_patterns
print(*(name for name in sys.argv[1:] if name in sys.modules))
"""


@pytest.mark.server
def test_a_server_loads_nothing_that_few_clinics_need(tmp_path: Path) -> None:
    done = run_python(tmp_path, "-c", SERVE, *OPTIONAL, *SELDOM)
    assert done.split() == []

"""The wheel, made from the archive of sources, is a whole clinic without this repository."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import time
import venv
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urljoin, urlsplit

import pytest

from tests.support.servers import ROOT, free_port

pytestmark = [pytest.mark.server, pytest.mark.long, pytest.mark.timeout(600)]
BUILD = "import sys; from setuptools import build_meta as b; getattr(b, sys.argv[1])('dist')"
PACKAGES = [
    "uplot/dist",
    "canvas-confetti/dist",
    "@fontsource-variable/atkinson-hyperlegible-next/files",
]


def build(folder: Path, what: str) -> Path:
    subprocess.run([sys.executable, "-c", BUILD, what], cwd=folder, check=True, capture_output=True)
    (made,) = (folder / "dist").iterdir()
    return made


def run(command: list[str], folder: Path, home: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, env=clean(home), capture_output=True, text=True)


def clean(home: Path) -> dict[str, str]:
    """Return an environment that says nothing but where pip finds packages."""
    pip = {name: value for name, value in os.environ.items() if name.startswith("PIP_")}
    return pip | {"HOME": str(home), "PATH": os.defpath, "LANG": "C.UTF-8"}


@pytest.fixture(scope="module")
def garry(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the command `garry` of a fresh environment."""
    folder = tmp_path_factory.mktemp("package")
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    sources = folder / "sources"
    for name in names.splitlines():
        if (ROOT / name).is_file():
            (sources / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, sources / name)
    for name in PACKAGES:
        shutil.copytree(ROOT / "node_modules" / name, sources / "node_modules" / name)
    with tarfile.open(build(sources, "build_sdist")) as archive:
        archive.extractall(folder, filter="data")
    (unpacked,) = folder.glob("garry-*")
    wheel = build(unpacked, "build_wheel")
    venv.create(folder / "venv", with_pip=True)
    python = folder / "venv" / "bin" / "python"
    for what in (["--require-hashes", "-r", str(ROOT / "locks/server.txt")], ["--no-deps", wheel]):
        subprocess.run([python, "-m", "pip", "install", "-q", *what], check=True)
    shutil.rmtree(sources)
    shutil.rmtree(unpacked)
    return python.with_name("garry")


def read(address: str, language: str = "en") -> str:
    place = urlsplit(address)
    connection = HTTPConnection(place.netloc, timeout=20)
    connection.request("GET", place.path, headers={"Accept-Language": language})
    answer = connection.getresponse()
    text = answer.read().decode(errors="replace")
    connection.close()
    if answer.status == 302:
        return read(urljoin(address, answer.headers["Location"]), language)
    assert answer.status == 200, address
    return text


def test_a_session_and_the_pages_without_the_repository(garry, tmp_path):
    walk = f"{garry} runsession --synthetic 7 --valence positive --strides 100 --speed max --json"
    walked = run(walk.split(), tmp_path, tmp_path)
    assert walked.returncode == 0, walked.stderr
    assert json.loads(walked.stdout)["strides"] == 100
    port = free_port()
    environment = clean(tmp_path) | {"GARRY_PORT": str(port)}
    with subprocess.Popen(
        [garry, "serve"], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
    ) as server:
        try:
            assert server.stdout is not None
            begun = time.monotonic()
            assert any(line.startswith("Ready.") for line in server.stdout)
            assert time.monotonic() - begun < 60
            address = f"http://127.0.0.1:{port}"
            assert "Anmelden" in read(f"{address}/start/", "de")
            for name in ("uplot/uPlot.iife.min.js", "css/shared/tokens.css", "docs/patient.png"):
                assert read(f"{address}/static/{name}")
            server.terminate()  # a Ctrl-C is ignored where a shell began this in the background
            assert server.wait(20) == 0
        finally:
            server.kill()
    assert (tmp_path / ".local" / "share" / "garry" / "garry.sqlite3").is_file()


@pytest.mark.parametrize("program", ["rehab.sources", "robot", "rehab.gait"])
def test_programs_beside_the_server_start(garry, program, tmp_path):
    done = run([str(garry.with_name("python")), "-m", program, "--help"], tmp_path, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "usage" in done.stdout


def test_its_plug_in_of_pytest_tries_what_packages_add(garry, tmp_path):
    python = [str(garry.with_name("python")), "-m"]
    folder = garry.parents[2]  # holds the environment, as people often have it
    (folder / "test_own.py").write_text("def test_own():\n    pass\n")
    packages = [tmp_path / name for name in ("garry-wagon", "garry-metronome")]
    for package in packages:
        shutil.copytree(ROOT / "examples" / package.name, package)
    built = ["--no-deps", "--no-build-isolation", *map(str, packages)]
    for what in (["--require-hashes", "-r", str(ROOT / "locks/test.txt")], built):
        installed = run([*python, "pip", "install", "-q", *what], tmp_path, tmp_path)
        assert installed.returncode == 0, installed.stderr
    tried = run([*python, "pytest", "-v", "--garry"], folder, tmp_path)
    assert tried.returncode == 0, tried.stdout + tried.stderr
    for told in ("test_own", "[wagon]", "[peek]", "[metronome]", "[beat_error]"):
        assert told in tried.stdout
    names = [package.name for package in packages]
    gone = run([*python, "pip", "uninstall", "-q", "-y", *names], tmp_path, tmp_path)
    assert gone.returncode == 0, gone.stderr
    tried = run([*python, "pytest", "-v", "--garry"], folder, tmp_path)
    assert tried.returncode == 0, tried.stdout + tried.stderr
    assert "[wagon]" not in tried.stdout

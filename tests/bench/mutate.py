"""Mutation bench (`make mutate`): change the product a little, and see whether a test notices.

Each mutant is one small change (a comparison, a number, a condition, a call that goes, …) in a copy
of the tree. One run of all tests tells which of them come to the changed statements (for what runs
while a module is imported: those in the folder that mirrors its own); a mutant meets those, the
quick files first, then all others of their files (which may share what one of them computed), and
is killed where one fails that passed before. Those that none comes to meet the tests of PostgreSQL
(DATABASE_URL); where no server answers they do not count. Which mutants are made depends on the
seed and on the code alone, so that two runs of one tree agree.

`--seed`, `--each` (mutants a package), `--only` (a package), `--tree` (another checkout).
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

import psycopg
import pytest

from tests.bench import mutation_probe
from tests.bench.mutants import Mutant, mutants, probed
from tests.bench.own_database import POSTGRES

ROOT = Path(__file__).parents[2]
TIMEOUT_S = 300  # beyond what a run of tests takes: a mutant that hangs is killed, too
AIM = 0.9
PACKAGES = (
    "rehab/training", "rehab/gait", "rehab/sessions/live", "rehab/people", "robot/behavior",
)  # fmt: skip
UNMARKED = "not (bench or screenshots or browser or realtime or long)"


def take_snapshot(checkout: Path, folder: Path) -> None:
    """Copy a checkout, which may change meanwhile."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=checkout, capture_output=True, text=True, check=True
    )
    ours = ["tests/bench/mutants.py", "tests/bench/mutation_probe.py"]
    for name in {*listed.stdout.splitlines(), *ours}:
        origin = ROOT if name in ours else checkout
        if (origin / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(origin / name, folder / name)
    (folder / "node_modules").symlink_to(checkout / "node_modules")


class Tree:
    """A copy of a snapshot, in which one file at a time is another."""

    on_postgresql = False  # its tests, which then are those marked so

    def __init__(self, snapshot: Path, folder: Path) -> None:
        self.snapshot, self.folder, self.notes = snapshot, folder / "tree", folder / "notes"
        self.notes.mkdir(parents=True)
        shutil.copytree(snapshot, self.folder, symlinks=True)

    def run(self, *arguments: str, timeout_s: float, **notes: Path) -> str:
        """Run tests; return the end of what they print where one fails (or hangs), else ""."""
        marks = f"postgres and {UNMARKED}" if self.on_postgresql else UNMARKED
        command = [sys.executable, "-m", "pytest", "-q", "-m", marks, "--timeout", "60"]
        command += ["-p", "no:cacheprovider", "-p", mutation_probe.__name__, *arguments]
        environment = os.environ | {
            "GARRY_TEST_TABLES": "mutants",  # no mutant changes a table
            "GARRY_TEST_DATA": os.environ.get("GARRY_TEST_DATA")
            or str((ROOT / "../shared/data").resolve()),
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONPATH": str(self.folder),
        }
        if self.on_postgresql:
            environment["GARRY_DATABASE_URL"] = POSTGRES
        environment |= {getattr(mutation_probe, name): str(file) for name, file in notes.items()}
        try:
            result = subprocess.run(
                command, cwd=self.folder, env=environment, capture_output=True, timeout=timeout_s
            )
        except subprocess.TimeoutExpired:
            return f"No end within {timeout_s} s."
        # What breaks before a test begins is told on the other stream.
        failed = result.returncode not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
        return (result.stdout + result.stderr).decode()[-2000:] if failed else ""

    def tests_of(self, chosen: list[Mutant]) -> list[dict[str, float]]:
        """Return the tests that pass without each mutant, of files that come to it, and what each
        takes [s]: those that come to it themselves first, and of these quick files.
        """
        places: dict[str, dict[int, int]] = defaultdict(dict)
        for number, mutant in enumerate(chosen):
            places[mutant.file][mutant.node] = number
        for name, numbers in places.items():
            source = (self.snapshot / name).read_text()
            (self.folder / name).write_text(probed(source, numbers))
        notes = {name: self.notes / name.lower() for name in ("HITS", "PASSED", "FAILED")}
        for note in notes.values():
            note.write_text("")
        self.run("-n", "2", "--dist", "worksteal", "tests", timeout_s=3600, **notes)
        for test in dict.fromkeys(notes["FAILED"].read_text().splitlines()):
            print(f"does not count, since it fails without a mutant, too: {test}", flush=True)
        for name in places:
            shutil.copy2(self.snapshot / name, self.folder / name)
        duration_s: dict[str, float] = {}
        for line in notes["PASSED"].read_text().splitlines():
            seconds, _, test = line.partition("\t")
            duration_s[test] = float(seconds)
        came: list[set[str]] = [set() for _ in chosen]
        for line in notes["HITS"].read_text().splitlines():
            place, _, test = line.partition("\t")
            came[int(place)].add(test or self.mirror(chosen[int(place)].file))
        return [_themselves_first(tests, duration_s) for tests in came]

    def mirror(self, file: str) -> str:
        """Return the folder of tests that mirrors a module's, or the innermost one around it."""
        folder = Path("tests", Path(file).parent.as_posix().removeprefix("rehab/"))
        while not (self.snapshot / folder).is_dir():
            folder = folder.parent
        return f"{folder.as_posix()}/"

    def killer(self, mutant: Mutant, tests: dict[str, float]) -> str:
        """Return the test that notices, twice, or ""."""
        (self.folder / mutant.file).write_text(mutant.source)
        try:
            for some in _in_rounds(list(tests)):
                while failed := self.fails(some, tests):
                    if failed not in some or self.fails([failed], tests):
                        return failed
                    some.remove(failed)  # it failed by chance
            return ""
        finally:
            shutil.copy2(self.snapshot / mutant.file, self.folder / mutant.file)

    def fails(self, some: list[str], duration_s: dict[str, float]) -> str:
        """Return the first of these tests that fails, or ""."""
        chosen, failed = self.notes / "chosen", self.notes / "failed"
        chosen.write_text("\n".join(some))
        failed.write_text("")
        files = dict.fromkeys(test.partition("::")[0] for test in some)
        timeout_s = TIMEOUT_S + 3 * sum(map(duration_s.__getitem__, some))
        if not self.run("-x", *files, timeout_s=timeout_s, CHOSEN=chosen, FAILED=failed):
            return ""
        return (*failed.read_text().splitlines(), "(no end, or no start)")[0]


def _themselves_first(came: set[str], duration_s: dict[str, float]) -> dict[str, float]:
    places = tuple(test.partition("::")[0] for test in came)
    file_of = {test: test.partition("::")[0] for test in duration_s if test.startswith(places)}
    took: dict[tuple[bool, str], float] = defaultdict(float)
    for test, file in file_of.items():
        took[test not in came, file] += duration_s[test]

    def order(test: str) -> tuple[bool, float, str]:
        others, file = key = test not in came, file_of[test]
        return others, took[key], file

    return {test: duration_s[test] for test in sorted(file_of, key=order)}


def _in_rounds(tests: list[str]) -> Iterator[list[str]]:
    """Yield the first 150 tests, and then the rest: most mutants die early."""
    yield from (some for some in (tests[:150], tests[150:]) if some)


def meet_all(trees: tuple[Tree, Tree], chosen: list[Mutant]) -> dict[Mutant, str]:
    """Return what kills each mutant that a test comes to, "" for a survivor."""
    found = trees[0].tests_of(chosen)
    tests = {mutant: some for mutant, some in zip(chosen, found, strict=True) if some}
    free: SimpleQueue[Tree] = SimpleQueue()
    for tree in trees:
        free.put(tree)

    def meet(mutant: Mutant) -> str:
        tree, began = free.get(), time.monotonic()
        killer = tree.killer(mutant, tests[mutant])
        free.put(tree)
        print(
            f"{'killed  ' if killer else 'SURVIVED'} {mutant.file}:{mutant.line} {mutant.what} "
            f"({time.monotonic() - began:.0f} s, {len(tests[mutant])} tests) {killer}",
            flush=True,
        )
        return killer

    with ThreadPoolExecutor(len(trees)) as pool:
        killers = dict(zip(tests, pool.map(meet, tests), strict=True))
    known = [killer for killer in killers.values() if "::" in killer]
    again = trees[0].notes / "chosen"
    again.write_text("\n".join(known))
    files = {killer.partition("::")[0] for killer in known}
    if files and (failed := trees[0].run(*files, timeout_s=TIMEOUT_S, CHOSEN=again)):
        print(f"{failed}\nThese fail without a mutant, too.", file=sys.stderr)
        sys.exit(2)
    return killers


def main() -> int:
    """Make mutants and name the survivors; return 1 where too many survive."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--each", type=int, default=14)
    parser.add_argument("--only", choices=PACKAGES)
    parser.add_argument("--tree", type=Path, default=ROOT)
    args = parser.parse_args()
    chosen: list[Mutant] = []
    with tempfile.TemporaryDirectory(prefix="garry-mutants-") as folder:
        snapshot = Path(folder, "snapshot")
        take_snapshot(args.tree.resolve(), snapshot)
        for package in PACKAGES:
            if args.only in (None, package):
                made = mutants(snapshot, package, random.Random(f"{args.seed} {package}"))
                chosen += [next(made) for _ in range(args.each)]
        trees = Tree(snapshot, Path(folder, "a")), Tree(snapshot, Path(folder, "b"))
        killers = meet_all(trees, chosen)
        unmet = [mutant for mutant in chosen if mutant not in killers]
        with suppress(psycopg.OperationalError):
            psycopg.connect(POSTGRES, connect_timeout=3).close()
            for tree in trees:
                tree.on_postgresql = True
            killers |= dict.fromkeys(unmet, "") | (meet_all(trees, unmet) if unmet else {})
    killed, total = sum(map(bool, killers.values())), len(killers)
    print(f"\n{killed} of {total} killed ({killed / total:.0%}, aim {AIM:.0%})")
    for mutant in chosen:
        if not killers.get(mutant):
            fate = "survived" if mutant in killers else "no test without PostgreSQL"
            print(f"  {fate}: {mutant.file}:{mutant.line} {mutant.what}: {mutant.statement}")
    return 0 if killed >= AIM * total else 1


if __name__ == "__main__":
    sys.exit(main())

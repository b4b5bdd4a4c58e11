"""Mutation bench (`make mutate`): change the product a little, and see whether a test notices.

Each mutant is one small change (a comparison, a number, a condition, a call that goes, …) in a copy
of the tree. It is killed where a test fails that passed before. The nearest tests run first; only
what survives them meets the further ones. Which mutants are made depends on the seed and on the
code alone, so that two runs of one tree agree.

`--seed`, `--each` (mutants a package), `--only` (a package), `--tree` (another checkout).
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
TIMEOUT_S = 600  # of one run of tests: a mutant that hangs is killed, too
AIM = 0.9

# Which tests look at a package: the nearest first.
PACKAGES: dict[str, tuple[tuple[str, ...], ...]] = {
    "rehab/training": (("tests/training",), ("tests/sessions", "tests/boards", "tests/feedback")),
    "rehab/gait": (("tests/gait",), ("tests/sources",)),
    "rehab/sessions/live": (("tests/sessions/live",), ("tests/sessions", "tests/management")),
    "rehab/people": (("tests/people",), ("tests/patients", "tests/api", "tests/stations")),
    "robot/behavior": (("tests/robot/behavior",), ("tests/robot",)),
}
_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult,
}  # fmt: skip
# Calls whose loss no test should have to notice.
_UNNOTICED = {"log", "logger", "logging", "debug", "info", "warning", "exception", "print"}


@dataclass(frozen=True)
class Mutant:
    """One change of one file: the node's place in `ast.walk`, and what was done."""

    file: str
    line: int
    node: int
    what: str
    source: str


def mutate(node: ast.AST) -> str | None:
    """Change a node in place; return what was done, or None where there is nothing to change."""
    match node:
        case ast.Compare(ops=[op, *_]) if type(op) in _COMPARED:
            new = _COMPARED[type(op)]()
            node.ops[0] = new
            return f"{type(op).__name__} → {type(new).__name__}"
        case ast.BinOp(op=op) if type(op) in _COMPUTED and not _is_text(node):
            node.op = _COMPUTED[type(op)]()
            return f"{type(op).__name__} → {type(node.op).__name__}"
        case ast.BoolOp(op=op):
            node.op = ast.Or() if isinstance(op, ast.And) else ast.And()
            return f"{type(op).__name__} → {type(node.op).__name__}"
        case ast.UnaryOp(op=ast.Not()):
            node.op = ast.UAdd()
            node.operand = ast.Call(ast.Name("bool", ast.Load()), [node.operand], [])
            return "not removed"
        case ast.Constant(value=bool(value)):
            node.value = not value
            return f"{value} → {not value}"
        case ast.Constant(value=int(value)):
            node.value = value + 1
            return f"{value} → {value + 1}"
        case ast.Constant(value=float(value)):
            node.value = value * 1.5 if value else 1.0
            return f"{value} → {node.value}"
        case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
            node.test = ast.UnaryOp(ast.Not(), test)
            return "condition negated"
        case ast.Expr(value=ast.Call() as call) if not _UNNOTICED & _names(call.func):
            node.value = ast.Constant(None)
            return f"call of {ast.unparse(call.func)} removed"
        case ast.Call(func=ast.Name(id="min" | "max" as name)):
            node.func = ast.Name("max" if name == "min" else "min", ast.Load())
            return f"{name} → {node.func.id}"
    return None


def _is_text(node: ast.BinOp) -> bool:
    sides = (node.left, node.right)
    return any(isinstance(s, ast.JoinedStr | ast.Constant) and not _is_number(s) for s in sides)


def _is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float)


def _names(func: ast.expr) -> set[str]:
    return {n.id if isinstance(n, ast.Name) else n.attr for n in ast.walk(func)
            if isinstance(n, ast.Name | ast.Attribute)}  # fmt: skip


def _inside_functions(tree: ast.Module) -> set[int]:
    """Return the ids of the nodes that run: bodies of functions, without annotations."""
    found: set[int] = set()
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            for statement in function.body:
                found.update(map(id, ast.walk(statement)))
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign | ast.arg) and node.annotation is not None:
            found.difference_update(map(id, ast.walk(node.annotation)))
    return found


def mutants(tree: Path, package: str, rng: random.Random) -> Iterator[Mutant]:
    """Yield mutants of a package without end, no node twice, files by how much they hold."""
    found: list[tuple[Path, int]] = []
    for file in sorted((tree / package).rglob("*.py")):
        module = ast.parse(file.read_text())
        running = _inside_functions(module)
        for place, node in enumerate(ast.walk(module)):
            if id(node) in running and mutate(copy.deepcopy(node)) is not None:
                found.append((file, place))
    rng.shuffle(found)
    for file, place in found:
        module = ast.parse(file.read_text())
        node = next(node for at, node in enumerate(ast.walk(module)) if at == place)
        what = mutate(node)
        assert what is not None
        source = ast.unparse(ast.fix_missing_locations(module))
        name = file.relative_to(tree).as_posix()
        yield Mutant(name, getattr(node, "lineno", 0), place, what, source)


class Tree:
    """A copy of a checkout, in which one file at a time is another."""

    def __init__(self, checkout: Path, folder: Path) -> None:
        self.checkout, self.folder = checkout, folder
        listed = subprocess.run(
            ["git", "ls-files"], cwd=checkout, capture_output=True, text=True, check=True
        )
        for name in listed.stdout.splitlines():
            if (checkout / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(checkout / name, folder / name)
        (folder / "node_modules").symlink_to(checkout / "node_modules")

    def fails(self, tests: tuple[str, ...]) -> str:
        """Return the end of what these tests print where they fail here (or hang), else ""."""
        unmarked = "not (bench or screenshots or browser or server or realtime or long or wide)"
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "2", "-m", unmarked]
        command += ["-p", "no:cacheprovider", "--timeout", "60", *tests]
        environment = os.environ | {
            "GARRY_TEST_TABLES": "mutants",  # no mutant changes a table
            "GARRY_TEST_DATA": str((ROOT / "../shared/data").resolve()),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        try:
            result = subprocess.run(
                command, cwd=self.folder, env=environment, capture_output=True, timeout=TIMEOUT_S
            )
        except subprocess.TimeoutExpired:
            return f"No end within {TIMEOUT_S} s."
        return result.stdout.decode()[-2000:] if result.returncode else ""

    def kills(self, mutant: Mutant, rounds: tuple[tuple[str, ...], ...]) -> bool:
        """Return whether a test notices."""
        (self.folder / mutant.file).write_text(mutant.source)
        try:
            return any(self.fails(self.existing(tests)) for tests in rounds)
        finally:
            shutil.copy2(self.checkout / mutant.file, self.folder / mutant.file)

    def existing(self, tests: tuple[str, ...]) -> tuple[str, ...]:
        """Return the folders of tests that this checkout has."""
        return tuple(name for name in tests if (self.folder / name).exists())


def main() -> int:
    """Make mutants and name the survivors; return 1 where too many survive."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--each", type=int, default=14)
    parser.add_argument("--only", choices=PACKAGES)
    parser.add_argument("--tree", type=Path, default=ROOT)
    args = parser.parse_args()
    killed, survivors = 0, []
    with tempfile.TemporaryDirectory(prefix="garry-mutants-") as folder:
        tree = Tree(args.tree.resolve(), Path(folder))
        for package, rounds in PACKAGES.items():
            if args.only not in (None, package):
                continue
            for tests in rounds:
                if found := tree.fails(tree.existing(tests)):
                    print(f"{found}\n{' '.join(tests)}: fails without a mutant.", file=sys.stderr)
                    return 2
            chosen = mutants(tree.checkout, package, random.Random(f"{args.seed} {package}"))
            for mutant in (next(chosen) for _ in range(args.each)):
                began = time.monotonic()
                is_killed = tree.kills(mutant, rounds)
                killed += is_killed
                survivors += [] if is_killed else [mutant]
                print(
                    f"{'killed  ' if is_killed else 'SURVIVED'} {mutant.file}:{mutant.line} "
                    f"{mutant.what} ({time.monotonic() - began:.0f} s)",
                    flush=True,
                )
    total = killed + len(survivors)
    print(f"\n{killed} of {total} killed ({killed / total:.0%}, aim {AIM:.0%})")
    for mutant in survivors:
        print(f"  survived: {mutant.file}:{mutant.line} {mutant.what}")
    return 0 if killed >= AIM * total else 1


if __name__ == "__main__":
    sys.exit(main())

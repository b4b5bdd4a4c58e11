"""Small changes of the product's code, as `make mutate` makes them."""

from __future__ import annotations

import ast
import copy
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Mutants that change nothing that anyone could see, by file and changed statement, and why.
EQUIVALENT: dict[tuple[str, str], str] = {
    (
        "rehab/training/valences.py",
        "if not 0 <= (self.hit_points or 1) <= POINTS_MAX:",
    ): "0 and 1 are both between the bounds",
    (
        "rehab/gait/one_leg.py",
        "return usual is not None and (not USUAL_MIN <= stance_s / usual < USUAL_MAX)",
    ): "measured times are never exactly at the bound",
    (
        "rehab/gait/wearables/detector.py",
        "if self._held[0].time_s <= time_s - HELD_S:",
    ): "one sample less of those that wait for the axis",
    (
        "rehab/gait/detector.py",
        "count = len(channels[1])",
    ): "where the channels differ in length nothing is written",
    (
        "rehab/sessions/live/daphne_server.py",
        "await asyncio.sleep(0.03)",
    ): "how often it looks whether the sockets are closed is no promise",
    (
        "rehab/gait/setup/find_forces.py",
        "return float(np.median(gaps)) <= 0.1",
    ): "a leg's columns are at most a few ms apart, two legs' half a second",
    (
        "rehab/gait/signals/buffer.py",
        "self._room, self._wide = (4 * keep, len(self.layout.order))",
    ): "more room moves the same samples more seldom",
    (
        "rehab/sessions/live/session/commit_transaction.py",
        "if connection.vendor == 'postgresql' and len(rows) > COPIED_ROWS:",
    ): "COPY and INSERT store the same",
    (
        "robot/behavior/cue.py",
        "return QUIET_PACE if self.is_quiet else 1.5",
    ): "no waypoint's own pace is above 1",
    (
        "robot/motion/pose.py",
        "straight = math.sin(half_rad) / half_rad if abs(half_rad) >= 1e-09 else 1.0",
    ): "sin x / x is 1 there, to the last digit",
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
    """One change of one file: the node's place in `ast.walk`, what was done, and what it became."""

    file: str
    line: int
    node: int
    what: str
    statement: str
    source: str

    @property
    def is_equivalent(self) -> bool:
        """Whether it is known that nothing can notice."""
        return (self.file, self.statement) in EQUIVALENT


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


def _statements(module: ast.Module) -> Iterator[tuple[list[ast.stmt], int, ast.stmt]]:
    """Yield the statements with the lists that they are in and their places there."""
    for node in ast.walk(module):
        for _, value in ast.iter_fields(node):
            if isinstance(value, list):
                yield from ((value, i, s) for i, s in enumerate(value) if isinstance(s, ast.stmt))


def _place_of(module: ast.Module, place: int) -> tuple[ast.AST, list[ast.stmt], int]:
    """Return a node by its place in `ast.walk`, and where the innermost statement around it is."""
    node = next(node for at, node in enumerate(ast.walk(module)) if at == place)
    *_, (inside, index, _) = (
        found for found in _statements(module) if any(n is node for n in ast.walk(found[2]))
    )
    return node, inside, index


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
        node, inside, index = _place_of(module, place)
        what = mutate(node)
        assert what is not None
        ast.fix_missing_locations(module)
        statement = ast.unparse(inside[index]).partition("\n")[0]
        name = file.relative_to(tree).as_posix()
        line = getattr(node, "lineno", 0)
        mutant = Mutant(name, line, place, what, statement, ast.unparse(module))
        if not mutant.is_equivalent:
            yield mutant


def probed(source: str, places: dict[int, int]) -> str:
    """Return a module that notes which tests come to its mutants: their numbers by place."""
    module = ast.parse(source)
    found = [(number, *_place_of(module, place)[1:]) for place, number in places.items()]
    for number, inside, index in sorted(found, key=lambda one: -one[2]):
        call = f'__import__("tests.bench.mutation_probe", fromlist=["hit"]).hit({number})'
        inside.insert(index, ast.parse(call).body[0])
    return ast.unparse(ast.fix_missing_locations(module))

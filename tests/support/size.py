"""The size of the project (`make size`): code by room, modules, circles, styles, documents."""

import ast
import io
import re
import statistics
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
PRODUCT = ("garry_site", "rehab", "robot")
DOCS = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs")
_NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
}  # fmt: skip


def code_lines(source: str) -> int:
    """Return how many lines of Python hold code: no blank, comment or docstring."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def declarations(css: str) -> list[str]:
    """Return the declarations (`name: value`) of a style sheet."""
    css = re.sub(r"/\*.*?\*/", "", css, flags=re.DOTALL)
    return [
        " ".join(found.split())
        for found in re.findall(r"(?<=[{;])\s*([-\w]+\s*:[^;{}]+)(?=[;}])", css)
    ]


def circles() -> list[list[str]]:
    """Return the groups of modules that import each other, directly or by others."""
    graph = grimp.build_graph(*PRODUCT)
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(
        module: str,
    ) -> None:  # Tarjan, SIAM J. Comput. 1 (1972): strongly connected components
        index[module] = low[module] = len(index)
        stack.append(module)
        for imported in graph.find_modules_directly_imported_by(module):
            if imported not in index:
                visit(imported)
            if imported in stack:
                low[module] = min(low[module], low[imported])
        if low[module] == index[module]:
            group = stack[stack.index(module) :]
            del stack[stack.index(module) :]
            if len(group) > 1:
                found.append(sorted(group))

    sys.setrecursionlimit(10_000)
    for module in sorted(graph.modules):
        if module not in index:
            visit(module)
    return found


def room(path: Path) -> str:
    """Return the room of a product file: `rehab/sessions/live`, `rehab/gait`, `robot/bases`."""
    parts = path.relative_to(ROOT).parts
    depth = 3 if parts[:2] == ("rehab", "sessions") else 2
    return "/".join(parts[:depth] if len(parts) > depth else parts[:-1])


def _files(*folders: str, suffix: str) -> Iterator[Path]:
    for folder in folders:
        path = ROOT / folder
        yield from [path] if path.is_file() else sorted(path.rglob(f"*{suffix}"))


def main() -> None:
    """Print the figures."""
    sizes = {path: code_lines(path.read_text()) for path in _files(*PRODUCT, suffix=".py")}
    rooms: Counter[str] = Counter()
    for path, lines in sizes.items():
        rooms[room(path)] += lines
    for name, lines in sorted(rooms.items()):
        print(f"{name:32}{lines:7}")
    modules = [
        lines
        for path, lines in sizes.items()
        if path.name != "__init__.py" and "migrations" not in path.parts
    ]
    longest = max(
        (path for path in sizes if "migrations" not in path.parts),
        key=lambda path: len(path.read_text().splitlines()),
    )
    tests = list(_files("tests", suffix=".py"))
    css = [
        declaration
        for path in _files("static/css", suffix=".css")
        for declaration in declarations(path.read_text())
    ]
    words = {
        path: len(path.read_text().split())
        for path in _files(*DOCS, suffix=".md")
        if not path.name.startswith("_")  # made by `make docs`
    }
    js = sum(len(path.read_text().splitlines()) for path in _files("static/js", suffix=".js"))
    rows = {
        "product, code lines without migrations": sum(rooms.values()) - rooms["rehab/migrations"],
        "product, files": len(sizes),
        "… of at most 40 lines, without __init__": sum(
            len(path.read_text().splitlines()) <= 40 for path in sizes if path.name != "__init__.py"
        ),
        "median module, code lines": statistics.median(modules),
        f"longest module ({longest.relative_to(ROOT)}), lines": len(
            longest.read_text().splitlines()
        ),
        "import circles": len(circles()),
        "tests, lines": sum(len(path.read_text().splitlines()) for path in tests),
        "tests, files": len(tests),
        "CSS declarations": len(css),
        "… of them distinct": len(set(css)),
        "JavaScript, lines": js,
        "documents, words": sum(words.values()),
        "changelog, bytes": (ROOT / "CHANGELOG.md").stat().st_size,
    }
    print()
    for name, figure in rows.items():
        print(f"{name:58}{figure:9,}")


if __name__ == "__main__":
    main()

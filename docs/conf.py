"""The documentation's site: `make docs`. Sphinx reads the whole project: all links hold."""

import json
import os
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
os.environ.setdefault("DJANGO_SETTINGS_MODULE", "garry_site.settings")

project = "GARRY"
copyright = "the GARRY authors"  # noqa: A001  # Sphinx's name
extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.napoleon", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = project
html_static_path: list[str] = []
root_doc = "docs/index"
include_patterns = [
    "docs/**.md",
    "docs/**.rst",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "SECURITY.md",
]
exclude_patterns = [
    *(["docs/_modules"] if tags.has("pages") else []),  # noqa: F821  # what `make docs` left
    ".venv*",
    "node_modules",
    "dist",
    "var",
    "tests",
    "deploy",
    "static",
    "templates",
    "rehab",
    "robot",
    "garry_site",
]
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline"]
suppress_warnings = ["myst.header", "misc.highlighting_failure", "ref.python"]
napoleon_use_ivar = True
PURE = {  # rooms without input, output and framework: what a researcher or a plug-in builds on
    "rehab": {"gait", "training"},
    "robot": {"behavior", "motion", "wire"},
}
apidoc_modules = (
    []
    if tags.has("pages")  # noqa: F821  # Sphinx's own
    else [
        {
            "path": str(ROOT / package),
            "destination": f"docs/_modules/{package}",
            "exclude_patterns": [
                str(part)
                for part in (ROOT / package).iterdir()
                if part.stem not in {"__init__", *rooms}
            ],
            "automodule_options": {"members", "ignore-module-all"},
            "separate_modules": True,
        }
        for package, rooms in PURE.items()
    ]
)
METHODS = ("get", "post", "put", "patch", "delete")


def describe_calls(schema: dict[str, Any]) -> str:
    """Return an OpenAPI document as Markdown, a section for each call."""
    lines = [
        "# Calls of the REST API",
        "",
        "Made from the OpenAPI document that each server has at `/api/v1/openapi.json`.",
    ]
    for path, calls in schema["paths"].items():
        for method in (name for name in METHODS if name in calls):
            call = calls[method]
            lines += [
                "",
                f"## {method.upper()} {path}",
                "",
                call.get("description") or call["summary"],
            ]
            given = call.get("parameters", [])
            body = call.get("requestBody", {}).get("content", {}).get("application/json", {})
            if given:
                lines += ["", "| parameter | in | type |", "|---|---|---|"]
                lines += [f"| `{p['name']}` | {p['in']} | {kind(p['schema'])} |" for p in given]
            if body:
                lines += ["", f"Body: {kind(body['schema'])}."]
            lines += ["", "| answer | content |", "|---|---|"]
            for code, answer in call["responses"].items():
                content = answer.get("content", {}).get("application/json", {}).get("schema")
                lines.append(f"| {code} | {kind(content) if content else answer['description']} |")
    lines += ["", "## What they send"]
    for name, shape in schema["components"]["schemas"].items():
        lines += ["", f"### {name}", "", "| field | type | meaning |", "|---|---|---|"]
        lines += [
            f"| `{field}` | {kind(described)} | {described.get('description', '')} |"
            for field, described in shape.get("properties", {}).items()
        ]
    return "\n".join(lines) + "\n"


def kind(shape: dict[str, Any]) -> str:
    """Return the type of a JSON schema in a few words."""
    if "$ref" in shape:
        name = shape["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    if choices := shape.get("anyOf"):
        return " or ".join(kind(one) for one in choices)
    if shape.get("type") == "array":
        return f"list of {kind(shape.get('items', {}))}"
    return str(shape.get("type", "any"))


def write_pages(app: Sphinx) -> None:
    """Write the pages that are made from the code, where they have changed."""
    import django

    django.setup()
    from rehab.api import api

    schema = json.loads(json.dumps(api.get_openapi_schema(path_prefix="/api/v1/"), default=str))
    modules = "".join(f"_modules/{package}/modules\n" for package in PURE if apidoc_modules)
    for name, text in {
        "_calls.md": describe_calls(schema),
        "_code.md": f"# Modules\n\nThe pure rooms.\n\n```{{toctree}}\n{modules}```\n",
    }.items():
        page = ROOT / "docs" / name
        if not page.is_file() or page.read_text("utf-8") != text:
            page.write_text(text, "utf-8")


def setup(app: Sphinx) -> None:
    """Have them written before Sphinx reads."""
    app.connect("builder-inited", write_pages, priority=400)

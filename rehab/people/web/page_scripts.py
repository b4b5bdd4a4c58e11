"""The modules that a page's scripts import, and where a browser finds them (static/js/)."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from django.conf import settings

FOLDER = Path(settings.FILES_DIR, "static", "js")
PACKAGES = {
    "uplot": "uplot/uPlot.esm.js",
    "canvas-confetti": "canvas-confetti/confetti.module.mjs",
}
SOCKET = "garry/shared/session_socket"
REPLAYED_SOCKET = "js/replay/session_socket.js"
_IMPORTED = re.compile(r'import [^"]*"([\w/-]+)";')


@cache
def find_modules(*scripts: str) -> dict[str, str]:
    """Return the files in static/, by name, that scripts import, themselves and through others.

    Parameters
    ----------
    scripts
        Files of static/js/ without ``.js``, ``"walk/walk"``. Without any: those of all pages.
    """
    found: dict[str, str] = {}
    paths = [FOLDER / f"{script}.js" for script in scripts] or sorted(FOLDER.rglob("*.js"))
    while paths:
        for name in _IMPORTED.findall(paths.pop().read_text("utf-8")):
            if name not in found:
                found[name] = PACKAGES.get(name) or f"{name.replace('garry', 'js', 1)}.js"
                if name not in PACKAGES:
                    paths.append(FOLDER.parent / found[name])
    return dict(sorted(found.items()))

"""What stands on a page: its text and its data."""

from __future__ import annotations

import html
import json
import re
from typing import Any


def plain(page: str) -> str:
    """Return a page with ordinary spaces only."""
    return page.replace("\N{NO-BREAK SPACE}", " ")


def words(markup: str) -> str:
    """Return the text of some markup."""
    return html.unescape(" ".join(re.sub(r"<[^>]+>", " ", markup).split()))


def article_words(page: str) -> str:
    """Return the text of a page's article: what is printed."""
    return words(plain(html.unescape(page.split("<article")[1].split("</article>", maxsplit=1)[0])))


def read_json(page: str, name: str) -> Any:
    """Return the data that a page holds for its scripts by that name."""
    return json.loads(re.search(rf'<script id="{name}"[^>]*>(.*?)</script>', page, re.DOTALL)[1])

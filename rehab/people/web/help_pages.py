"""docs/using.md as a page, and which part of it helps on which page."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

from django.conf import settings
from django.templatetags.static import static
from markdown_it import MarkdownIt

# The name of a page's address → the heading that it is told under, as GitHub writes its anchor.
PARTS = {
    "start": "today",
    "new-patient": "today",
    "edit-patient": "today",
    "records": "today",
    "consent": "today",
    "patient": "start-three-taps",
    "setup": "start-three-taps",
    "monitor": "watch-and-steer",
    "scores": "scores",
    "session": "the-session-and-its-report",
    "replay": "the-session-again",
    "report": "the-session-and-its-report",
    "incident": "the-robot",
    "correct": "what-to-do-when-",
    "history": "progress",
    "insight": "insight",
    "take-home": "progress",
    "pair": "pair-the-tablet",
    "first-steps": "first-steps",
    "stations": "stations-and-devices",
    "new-station": "stations-and-devices",
    "edit-station": "set-the-pin",
    "new-device": "connect-the-sensor",
    "check-recording": "connect-the-sensor",
    "screen": "the-patients-screen",
    "family-links": "progress",
    "studies": "studies",
    "study": "studies",
    "plan-study": "studies",
    "new-study": "studies",
    "enroll": "studies",
    "participant": "studies",
}
# Of the admin's models.
ADMIN_PARTS = {
    "patient": "today",
    "trainingsession": "the-session-and-its-report",
    "preset": "start-three-taps",
    "feedbacktype": "what-the-patient-sees",
    "protocol": "start-three-taps",
    "composedgesture": "the-robot",
    "questionnaire": "questions-after-a-session",
    "leaderboard": "leaderboards",
    "station": "stations-and-devices",
    "device": "stations-and-devices",
}


def find_part(name: str) -> str:
    """Return the heading that helps on a page, by its address's name; "" where none does."""
    if name.startswith("rehab_"):  # as Django's admin names them: rehab_protocol_change
        return ADMIN_PARTS.get(name.split("_")[1], "")
    return PARTS.get(name, "")


def using_guide() -> str:
    """Return docs/using.md as HTML; "" on a server without it."""
    file = Path(settings.BASE_DIR, "docs", "using.md")
    return render_guide(file.read_text("utf-8")) if file.is_file() else ""


@cache
def render_guide(text: str) -> str:
    """Return a guide of ours as HTML: headings have GitHub's anchors, pictures our addresses."""
    markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
    tokens = markdown.parse(text)
    for opened, inline in pairwise(tokens):
        if opened.type == "heading_open":
            opened.attrSet("id", anchor_of(inline.content))
    html = str(markdown.renderer.render(tokens, markdown.options, {}))
    html = re.sub(
        r'src="images/([^"]+)"', lambda found: f'src="{static("docs/" + found[1])}"', html
    )
    # Other pages of the documentation are not served here.
    html = re.sub(r'<a href="(?!#|https?:)[^"]*">(.*?)</a>', r"\1", html, flags=re.DOTALL)
    html = html.replace("<th></th>", "<td></td>")  # Markdown has no table without a head
    return html.replace("<table>", '<div class="wide"><table>').replace(
        "</table>", "</table></div>"
    )


def anchor_of(heading: str) -> str:
    """Return GitHub's anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")

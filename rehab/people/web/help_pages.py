"""docs/using.md as a page, and which part of it helps on which page."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

from django.conf import settings
from django.templatetags.static import static
from markdown_it import MarkdownIt

# The heading, as GitHub writes its anchor, and the pages that it helps on, by their addresses'
# names; an admin's page has its model's.
PAGES = {
    "today": "start new-patient edit-patient records consent rehab_patient",
    "start-three-taps": "patient setup rehab_preset rehab_protocol",
    "watch-and-steer": "monitor",
    "scores": "scores",
    "the-session-and-its-report": "session report rehab_trainingsession",
    "the-session-again": "replay",
    "the-robot": "incident rehab_composedgesture",
    "what-to-do-when-": "correct",
    "progress": "history take-home family-links",
    "insight": "insight",
    "pair-the-tablet": "pair",
    "first-steps": "first-steps",
    "stations-and-devices": "stations new-station rehab_station rehab_device",
    "set-the-pin": "edit-station",
    "connect-the-sensor": "new-device check-recording",
    "the-patients-screen": "screen",
    "studies": "studies study plan-study new-study enroll participant",
    "what-the-patient-sees": "rehab_feedbacktype",
    "questions-after-a-session": "rehab_questionnaire",
    "leaderboards": "rehab_leaderboard",
}
PARTS = {name: heading for heading, names in PAGES.items() for name in names.split()}


def find_part(name: str) -> str:
    """Return the heading that helps on a page, by its address's name; "" where none does."""
    if name.startswith("rehab_"):  # as Django's admin names them: rehab_protocol_change
        name = name.rpartition("_")[0]
    return PARTS.get(name, "")


def using_guide() -> str:
    """Return docs/using.md as HTML; "" on a server without it."""
    file = Path(settings.FILES_DIR, "docs", "using.md")
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

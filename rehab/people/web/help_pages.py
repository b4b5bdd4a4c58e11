"""The documentation as pages, and which part of docs/using.md helps on which page."""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

from django.conf import settings
from django.templatetags.static import static
from django.urls import reverse
from markdown_it import MarkdownIt

from rehab.people.commands import as_typed_here
from rehab.people.models import Clinic, User
from rehab.people.roles import Role

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
    "standard-tests": "assessments assess rehab_clinictest",
    "caseload": "caseload",
    "hit-rates-compared": "insight",
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


def may_report(user: User) -> bool:
    """Return whether a person may report a problem with the counts of all clinics' rows."""
    is_only = user.role == Role.LEAD and Clinic.everywhere.count() == 1
    return user.role == Role.HOST or is_only


def read_page(name: str, address: str) -> str:
    """Return a page of docs/ as HTML, as things are called at this server; "" where there is none.

    ``name`` is a slug, ``address`` the one that the reader has of this server.
    """
    file = _file_of(name)
    return render_page(as_typed_here(file.read_text("utf-8"), address)) if file.is_file() else ""


def _file_of(name: str) -> Path:
    return Path(settings.FILES_DIR, "docs", f"{name}.md")


@lru_cache(maxsize=64)  # the address in it is the reader's
def render_page(text: str) -> str:
    """Return a page as HTML: headings have GitHub's anchors, pictures and pages our addresses."""
    markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
    tokens = markdown.parse(text)
    for opened, inline in pairwise(tokens):
        if opened.type == "heading_open":
            opened.attrSet("id", anchor_of(inline.content))
    html = str(markdown.renderer.render(tokens, markdown.options, {}))
    html = re.sub(
        r'src="images/([^"]+)"', lambda found: f'src="{static("docs/" + found[1])}"', html
    )
    html = re.sub(r'href="([a-z-]+)\.md(#[^"]*)?"', _link, html)
    # What is not of the package leads nowhere here.
    html = re.sub(r'<a href="(?!#|https?:|/)[^"]*">(.*?)</a>', r"\1", html, flags=re.DOTALL)
    html = html.replace("<th></th>", "<td></td>")  # Markdown has no table without a head
    return html.replace("<table>", '<div class="wide"><table>').replace(
        "</table>", "</table></div>"
    )


def _link(found: re.Match[str]) -> str:
    """Return the link to another page; one that is not here is left as it is."""
    if not _file_of(found[1]).is_file():
        return found[0]
    return f'href="{reverse("help-page", args=[found[1]])}{found[2] or ""}"'


def anchor_of(heading: str) -> str:
    """Return GitHub's anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")

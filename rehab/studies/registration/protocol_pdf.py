"""The registered study as a document on paper (PDF), the same bytes for the same study."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any
from xml.sax.saxutils import escape

from django.utils.text import capfirst
from django.utils.translation import gettext, ngettext
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import getSampleStyleSheet
from reportlab.lib.units import mm
from reportlab.platypus import Flowable, Paragraph, SimpleDocTemplate, Spacer, Table, TableStyle

from rehab.sessions.formatting import format_schedule
from rehab.studies.allocation.draws import RULE
from rehab.studies.allocation.scheme import Method
from rehab.studies.models import METHODS, SPENDINGS, Study, StudyVersion, outcome_label
from rehab.studies.registration.estimands import (
    HARMS_FOLLOWED,
    METHOD,
    POPULATIONS,
    outcomes_of,
    registered_outcomes,
    summary,
)
from rehab.studies.registration.facts import ASKED
from rehab.studies.registration.outcome_changes import outcome_changes
from rehab.studies.registration.size import size_of_document
from rehab.training.schedules import Schedule, ScheduleKind

MARGIN = 20 * mm
LINES = TableStyle(
    [
        ("GRID", (0, 0), (-1, -1), 0.4, "#999999"),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("BACKGROUND", (0, 0), (-1, 0), "#eeeeee"),
    ]
)
STYLES = getSampleStyleSheet()


def write_pdf(study: Study) -> bytes:
    """Return the study with all its versions, newest first."""
    target = io.BytesIO()
    document = SimpleDocTemplate(
        target,
        pagesize=A4,
        title=str(study),
        author=study.clinic.name,
        leftMargin=MARGIN,
        rightMargin=MARGIN,
        invariant=1,  # no date of making and no random number in the file
        pageCompression=0,
    )
    parts: list[Flowable] = []
    if changes := outcome_changes(study):
        parts.append(_text(gettext("Outcomes were changed after the registration"), "Heading1"))
        parts += [_text(change) for change in changes]
    for version in study.versions.order_by("-number"):
        parts += _version_parts(version)
    parts.append(_text(gettext("How to allocate again from the seed"), "Heading2"))
    parts += [_text(line) for line in RULE.splitlines()]
    document.build(parts)
    return target.getvalue()


def _text(words: object, style: str = "BodyText") -> Paragraph:
    return Paragraph(escape(str(words)).replace("\n", "<br/>"), STYLES[style])


def _version_parts(version: StudyVersion) -> Iterator[Flowable]:
    """Yield the parts of the document for one version."""
    document = version.document
    yield _text(f"{document['code']}: {document['title']}", "Title")
    made = gettext("Version %(number)d of %(moment)s UTC, %(clinic)s")
    moment = f"{version.at:%Y-%m-%d %H:%M}"
    yield _text(made % {"number": version.number, "moment": moment, "clinic": document["clinic"]})
    if version.reason:
        yield _text(gettext("Changed because: %(reason)s") % {"reason": version.reason})
    yield _text(gettext("Question and hypothesis"), "Heading2")
    yield _text(document["question"])
    yield _text(gettext("Arms"), "Heading2")
    yield _table(_arm_rows(document))
    for arm in document["arms"]:
        yield _text(
            gettext("Phases of %(arm)s (%(protocol)s): %(phases)s")
            % {
                "arm": arm["code"],
                "protocol": arm["protocol"],
                "phases": "; ".join(map(_phase_text, arm["phases"])),
            }
        )
        if "feedback" in arm:
            edited = {"arm": arm["code"], "feedback": _feedback_text(arm["feedback"])}
            yield _text(
                gettext("Feedback of %(arm)s, as the clinic edited it: %(feedback)s") % edited
            )
        for asked in arm.get("questionnaires", ()):
            asked_of = {"arm": arm["code"], "questionnaire": asked["title"]}
            yield _text(gettext("Asked after sessions of %(arm)s: %(questionnaire)s") % asked_of)
    yield _text(gettext("Plan"), "Heading2")
    yield _table([(gettext("What"), gettext("Planned")), *plan_rows(document)])
    yield _text(f"{summary(document)} {METHOD} {POPULATIONS.format(counted='')}")
    yield _text(gettext("Outcomes"), "Heading2")
    yield _table([(gettext("What"), gettext("Unit"), gettext("How")), *_outcome_rows(document)])
    if phase := document["visits"].get("days_to_follow_up") and _follow_up(document):
        yield _text(gettext("At the follow-up") + f": {phase}")
    yield _text(gettext("Harms"), "Heading2")
    yield _text(HARMS_FOLLOWED)
    if asked := document.get("facts"):
        yield _text(gettext("Record of the study"), "Heading2")
        yield _table([(ASKED[slug], asked[slug]) for slug in ASKED if slug in asked])
    yield _text(gettext("Seals (SHA-256)"), "Heading2")
    yield _text(gettext("Of this version, as JSON with sorted keys and without blanks:"))
    yield _text(version.digest, "Code")
    yield _text(gettext("Of the seed, block sizes or list that participants are allocated by:"))
    yield _text(document["allocation"]["commitment_sha256"], "Code")
    yield Spacer(1, 10 * mm)


def _outcome_rows(document: dict[str, Any]) -> Iterator[tuple[object, ...]]:
    outcomes = outcomes_of(document)
    for slug in registered_outcomes(document):
        one = outcomes.get(slug)
        unit, meaning = (one.scale, one.meaning) if one else ("", None)
        yield outcome_label(outcomes, slug), unit and gettext(unit), meaning


def _follow_up(document: dict[str, Any]) -> str:
    """Return what is walked at the follow-up: the first baseline of the protocol."""
    baselines = (phase for phase in document["arms"][0]["phases"] if phase["kind"] == "baseline")
    return next(map(_phase_text, baselines), "")


def _table(rows: list[tuple[object, ...]]) -> Table:
    cells = [[_text("–" if cell in (None, "") else cell) for cell in row] for row in rows]
    return Table(cells, style=LINES, hAlign="LEFT", repeatRows=1)


def _arm_rows(document: dict[str, Any]) -> list[tuple[object, ...]]:
    heads = ("Code", "Name", "Ratio", "Feedback type", "Feedback comes", "Gain", "Robot", "Measure")
    keys = ("code", "name", "weight", "feedback_type", "comes", "gain", "robot_intensity")
    return [
        tuple(gettext(head) for head in heads),
        *(
            tuple((arm | {"comes": _comes(arm)})[key] for key in (*keys, "measure"))
            for arm in document["arms"]
        ),
    ]


def _comes(arm: dict[str, Any]) -> str:
    """Return when an arm's feedback comes; arms of before there was a choice answer every step."""
    schedule = arm.get("schedule", {})
    return format_schedule(
        Schedule(**schedule | {"kind": ScheduleKind(schedule.get("kind", "every"))})
    )


def _phase_text(phase: dict[str, Any]) -> str:
    """Return a phase in a few words: its name, lengths, gain, and what else it does."""
    strides, seconds = phase["strides"], phase["seconds"]
    parts = [phase["name"]]
    if strides:
        parts.append(
            ngettext("%(count)d stride", "%(count)d strides", strides) % {"count": strides}
        )
    if seconds:
        parts.append(f"{seconds:g} s")
    if phase["feedback"]:
        parts.append(gettext("feedback, gain %(gain)g") % {"gain": phase["gain"]})
    if phase.get("goal_percent"):
        percent = f"{phase['goal_percent']:g} %"
        parts.append(gettext("goal at %(percent)s of baseline") % {"percent": percent})
    if not phase.get("robot", True):
        parts.append(gettext("without the robot"))
    if phase.get("rest_s"):
        parts.append(gettext("then a rest of %(seconds)g s") % {"seconds": phase["rest_s"]})
    return ", ".join(parts)


def _feedback_text(feedback: dict[str, Any]) -> str:
    """Return points and words of a feedback type that the clinic edited."""
    points = " / ".join(f"{feedback[name]}" for name in ("hit_points", "miss_points"))
    bands = (
        f"{band['from_percent']} %: {' / '.join(band['words'].values()) or '–'}"
        for band in feedback["bands"]
    )
    return "; ".join((points.replace("None", "–"), *bands))


def plan_rows(document: dict[str, Any]) -> list[tuple[object, ...]]:
    """Return what is planned beside the arms: name and value, without what is left open."""
    visits, allocation = document["visits"], document["allocation"]
    outcomes = outcomes_of(document)
    primary, *others = (outcome_label(outcomes, slug) for slug in registered_outcomes(document))
    factors = (f"{row['name']}: {', '.join(row['levels'])}" for row in allocation["factors"])
    months = document["months_since_stroke_at_least"]
    analysis, crossed = document.get("analysis", {}), document["design"] == "crossover"
    rows = [
        (gettext("Participants"), document["participants"]),
        (gettext("Months since the stroke, at least"), months),
        (gettext("Criteria of inclusion"), "\n".join(document.get("inclusion", ()))),
        (gettext("Criteria of exclusion"), "\n".join(document.get("exclusion", ()))),
        (gettext("Design"), document["design"]),
        (gettext("Allocation"), METHODS[Method(allocation["method"])]),
        (gettext("Groups"), ", ".join("-".join(row["arms"]) for row in allocation["groups"])),
        (gettext("Factors"), "; ".join(factors)),
        (gettext("Visits in each period"), visits["in_each_period"]),
        (gettext("Days between visits"), visits["days_between"]),
        (gettext("Days between periods"), visits["days_between_periods"] if crossed else None),
        (gettext("Days to the follow-up"), visits.get("days_to_follow_up")),
        (Study._meta.get_field("window_days").verbose_name, visits.get("window_days")),
        (gettext("Goal (% of baseline)"), f"{document['goal_percent_of_baseline']:g}"),
        (gettext("Primary outcome"), primary),
        (gettext("Secondary outcomes (others are exploratory)"), ", ".join(others)),
        (Study._meta.get_field("margin").verbose_name, analysis.get("margin")),
        (Study._meta.get_field("spending").verbose_name, SPENDINGS.get(analysis.get("spending"))),
        (Study._meta.get_field("planned_sd").verbose_name, analysis.get("planned_sd")),
        (gettext("Why so many"), size_of_document(document)),
        (gettext("Version of the scoring rules"), document["scoring_rules_version"]),
    ]
    return [(capfirst(name), value) for name, value in rows if value not in (None, "")]

"""Adverse events of a study's participants: proposed from the logs, judged, reported in time."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from itertools import groupby
from operator import attrgetter
from typing import Any, ClassVar

from django.db import models
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import ACCOUNT_DELETED, Allowed, AppendOnlyModel
from rehab.people.consent.models import PatientScope
from rehab.people.field_policy import erased, personal_fields, retained
from rehab.people.models import User
from rehab.sessions.alarms import UNASKED
from rehab.sessions.log import RobotEntry, SessionEvent
from rehab.sessions.reports.remarks import ABOUT_A_FALL, read_noted
from rehab.studies.models import Study, StudyMark, has_mark
from rehab.studies.participants import Enrollment
from rehab.studies.results.harms_and_deviations import HARMS
from rehab.training.measures import InvalidSetting

# Days until a serious event has to be reported: each one to the sponsor (ICH E6 (R2), 4.11.1, at
# once; Regulation (EU) 536/2014, article 41, 24 hours); by the sponsor to authority and ethics
# board, if related and unexpected: 7 where a life was in danger or lost, else 15 (ICH E2A, III.B).
SPONSOR_DAYS, FATAL_DAYS, UNEXPECTED_DAYS = 1, 7, 15
LIFE_THREATENING = 4


class Grade(models.IntegerChoices):
    """How bad it was: the grades of CTCAE 5.0 (National Cancer Institute 2017)."""

    NONE = 0, _("no adverse event")
    MILD = 1, _("mild")
    MODERATE = 2, _("moderate")
    SEVERE = 3, _("severe")
    THREATENING = 4, _("a danger to life")
    DEATH = 5, _("death")


class Relation(models.TextChoices):
    """Whether the study's treatment caused it."""

    NONE = "none", _("not related")
    POSSIBLE = "possible", _("possibly related")
    PROBABLE = "probable", _("probably related")
    CERTAIN = "certain", _("certainly related")


class AdverseEvent(AppendOnlyModel):
    """What happened to a participant, as it was judged. ``entry``: the log that proposed it."""

    scope = PatientScope(clinic="enrollment__clinic", patient="enrollment__patient")
    allowed_changes = (
        ACCOUNT_DELETED,
        Allowed(("reported_at",), "OLD.reported_at IS NULL"),
        Allowed(("what",), "NEW.what = ''"),
    )

    enrollment = models.ForeignKey(
        Enrollment, on_delete=models.PROTECT, related_name="adverse_events"
    )
    entry = models.OneToOneField(
        SessionEvent, on_delete=models.PROTECT, related_name="adverse_event", null=True
    )
    what = models.CharField(_("what happened"), max_length=200, blank=True)
    grade = models.PositiveSmallIntegerField(_("how bad"), choices=Grade.choices)
    serious = models.BooleanField(
        _("serious"),
        default=False,
        help_text=_("Death, danger to life, hospital, lasting disability."),
    )
    relation = models.CharField(_("caused by the study"), max_length=8, choices=Relation.choices)
    expected = models.BooleanField(_("expected"), default=False)
    at = models.DateTimeField(_("known since"), default=timezone.now)
    by = models.ForeignKey(User, on_delete=models.SET_NULL, related_name="+", null=True)
    reported_at = models.DateTimeField(_("reported"), null=True)

    personal = personal_fields(
        {
            "what": erased("", shown=True, research=False),
            "enrollment entry grade serious relation expected at reported_at": retained(
                "the safety of a study's treatment, under a code", shown=True, research=False
            ),
            "by": retained("staff", shown=False, research=False),
        }
    )

    class Meta(AppendOnlyModel.Meta):
        verbose_name = _("adverse event")
        ordering: ClassVar = ["pk"]

    def __str__(self) -> str:
        return f"{self.enrollment}: {self.get_grade_display()}"

    @property
    def is_serious(self) -> bool:
        """Whether it is serious, as any danger to life is."""
        return self.serious or self.grade >= LIFE_THREATENING

    @property
    def due_at(self) -> datetime | None:
        """By when the sponsor has to know; None of one that is not serious."""
        return self.at + timedelta(days=SPONSOR_DAYS) if self.is_serious else None

    @property
    def authority_due_at(self) -> datetime | None:
        """By when authority and ethics board have to know; None unless related, unexpected."""
        if not self.is_serious or self.expected or self.relation == Relation.NONE:
            return None
        is_fatal = self.grade >= LIFE_THREATENING
        return self.at + timedelta(days=FATAL_DAYS if is_fatal else UNEXPECTED_DAYS)


def propose(study: Study) -> list[tuple[Enrollment, SessionEvent]]:
    """Return the falls, other harms and robot's stops of a study that nobody has judged yet."""
    kinds = (*HARMS, *ABOUT_A_FALL, RobotEntry.STOP.value)
    of_study = {"session__study_visit__enrollment__study": study, "kind__in": kinds}
    related = ("session__study_visit__enrollment", "adverse_event")
    events = SessionEvent.everywhere.filter(**of_study).select_related(*related)
    found: list[SessionEvent] = []
    for _session, of_session in groupby(events.order_by("session", "pk"), attrgetter("session_id")):
        logged = list(of_session)
        harms = [one.event for one in read_noted(logged) if one.is_adverse]
        stops = [one for one in logged if one.kind == RobotEntry.STOP and UNASKED not in one.data]
        found += [one for one in logged if one in stops or one in harms]
    unjudged = [event for event in found if getattr(event, "adverse_event", None) is None]
    return [(event.session.study_visit.enrollment, event) for event in unjudged]


def record(event: AdverseEvent, now: datetime) -> AdverseEvent:
    """Store an event that was judged.

    Parameters
    ----------
    event
        With all fields but the moment; one of the log belongs to the participant.
    now
        Since when it is known; for an entry of the log, since then.

    Raises
    ------
    InvalidSetting
        Without words for what no log tells, and for an entry that was judged already.
    """
    if event.entry is None and not event.what.strip():
        raise InvalidSetting(gettext("Say what happened."))
    if event.entry is not None:
        if AdverseEvent.everywhere.filter(entry=event.entry).exists():
            raise InvalidSetting(gettext("This was judged already. Reload the page."))
        event.what = event.what or event.entry.kind
    event.at = event.entry.at if event.entry is not None else now
    event.save()
    return event


def report(event: AdverseEvent, now: datetime) -> None:
    """Record that an event was reported; once. ``now``: when."""
    unreported = AdverseEvent.everywhere.filter(pk=event.pk, reported_at__isnull=True)
    unreported.update(reported_at=now)


def may_monitor(study: Study, user: User) -> bool:
    """Return whether an account sees harms by arm. ``user``: of a closed study, not asked."""
    return has_mark(study, user, StudyMark.Task.MONITOR)


def listing_rows(study: Study, *, by_arm: bool) -> Iterator[dict[str, Any]]:
    """Yield one row for each adverse event, its days counted from the enrollment.

    Parameters
    ----------
    study
        The study.
    by_arm
        Whether rows name the arm: for a monitor, and once the study is closed.
    """
    events = AdverseEvent.everywhere.filter(enrollment__study=study, grade__gt=Grade.NONE)
    related = ("enrollment__allocation", "entry__session__study_visit")
    for one in events.select_related(*related).order_by("pk"):
        began = one.enrollment.enrolled_at
        moments = {
            "known": one.at,
            "due": one.due_at,
            "authority_due": one.authority_due_at,
            "reported": one.reported_at,
        }
        yield {
            "participant": one.enrollment.code,
            "arm": arm_of(one) if by_arm else "",
            "what": one.what,
            "grade": one.grade,
            "serious": one.is_serious,
            "relation": one.relation,
            "expected": one.expected,
            **{f"{name}_on_day": at and (at - began).days for name, at in moments.items()},
        }


def arm_of(event: AdverseEvent) -> str:
    """Return the code of the arm in which it happened; all of a group where no visit tells it."""
    group = event.enrollment.allocation.group
    if event.entry is None:
        return group
    return group.split("-")[event.entry.session.study_visit.period]

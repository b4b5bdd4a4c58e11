"""Questionnaires of sessions: a clinic's own ones, what is planned, and what was answered."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.db import models, transaction
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.field_policy import personal_fields, retained
from rehab.people.models import Clinic
from rehab.people.models.clinics import language_choices
from rehab.people.scope import ClinicModel, Scope, ScopedModel
from rehab.people.web.refusals import format_refusal
from rehab.questionnaires.instrument import Instrument, read_items
from rehab.questionnaires.shipped import SHIPPED, shipped_instrument
from rehab.sessions.models import SessionScope, TrainingSession
from rehab.training.measures import InvalidSetting

OWN = "own-"  # begins the slug of a clinic's own questionnaire


class Questionnaire(ClinicModel):
    """A questionnaire of a clinic's own, in one language: free items with scales."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="questionnaires", verbose_name=_("clinic")
    )
    name = models.CharField(_("name"), max_length=64)
    intro = models.CharField(_("words above each question"), max_length=200, blank=True, default="")
    language = models.CharField(_("language"), max_length=8, choices=language_choices, default="en")
    items = models.TextField(
        _("questions"),
        max_length=12_000,
        help_text=_(
            "A line each, with the words at both ends of its scale and the number of points: "
            "“How tired are you? | not at all | very | 7”."
        ),
    )
    source = models.CharField(
        _("where it is from, and why you may use it"), max_length=300, blank=True
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("questionnaire")
        verbose_name_plural = _("questionnaires")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "name"], name="questionnaire_name_once_per_clinic"
            )
        ]

    def __str__(self) -> str:
        return self.name

    @property
    def slug(self) -> str:
        """What protocols and answers call it."""
        return f"{OWN}{self.pk}"

    def to_instrument(self) -> Instrument:
        """Return it in the form that the rules use. Raises InvalidSetting."""
        items = read_items(self.items)
        return Instrument(
            self.slug, self.name, self.intro, self.language, items, source=self.source
        )

    def clean(self) -> None:
        """Refuse what the rules refuse, with their message."""
        try:
            self.to_instrument()
        except InvalidSetting as problem:
            raise ValidationError({"items": format_refusal(problem)}) from problem


def questionnaire_choices(clinic_id: int | None) -> list[tuple[str, str]]:
    """Return slug and name of everything that a clinic can ask."""
    own = Questionnaire.everywhere.filter(clinic=clinic_id) if clinic_id else ()
    return [*SHIPPED.items(), *((row.slug, row.name) for row in own)]


def find_instrument(slug: str, clinic_id: int, language: str) -> Instrument:
    """Return a questionnaire in a language. Raises InvalidSetting for one that is not there."""
    if slug in SHIPPED:
        return shipped_instrument(slug, language)
    key = slug.removeprefix(OWN)
    rows = Questionnaire.everywhere.filter(clinic=clinic_id)
    row = rows.filter(pk=int(key)).first() if key.isdecimal() and len(key) < 19 else None
    if row is None:
        raise InvalidSetting(
            gettext(
                "A questionnaire that is planned here was deleted. Open the protocol in Admin and "
                "choose its questionnaires again."
            )
        )
    return row.to_instrument()


class QuestionnaireResponse(ScopedModel):
    """A questionnaire of one session: as it was asked, and what was answered.

    ``instrument`` has the words as they were asked, so that later changes of a clinic's own
    questions change no earlier answer. ``answers`` has one place for each question that was
    reached: null is skipped.
    """

    scope = SessionScope(
        clinic="session__clinic", station="session__station", patient="session__patient"
    )

    session = models.ForeignKey(
        TrainingSession,
        on_delete=models.PROTECT,
        related_name="questionnaires",
        verbose_name=_("session"),
    )
    slug = models.CharField(_("questionnaire"), max_length=32)
    instrument = models.JSONField()
    answers = models.JSONField(_("answers"), default=list)
    asked_at = models.DateTimeField(_("planned at"), default=timezone.now)
    finished_at = models.DateTimeField(_("finished at"), null=True)

    personal = personal_fields(
        {
            "session slug instrument answers asked_at finished_at": retained(
                "points on the clinic's own scales, under a pseudonym", shown=True, research=True
            )
        }
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("answered questionnaire")
        verbose_name_plural = _("answered questionnaires")
        ordering: ClassVar = ["session", "pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["session", "slug"], name="questionnaire_once")
        ]

    def __str__(self) -> str:
        return str(self.instrument["title"])

    def to_instrument(self) -> Instrument:
        """Return the questionnaire as it was asked."""
        return Instrument.from_json(self.instrument)

    @property
    def all_answers(self) -> list[int | None]:
        """An answer for each question; None where it was skipped or not reached."""
        missing = len(self.instrument["items"]) - len(self.answers)
        return [*self.answers, *[None] * missing]

    @property
    def score(self) -> float | None:
        """What the answers come to, if all were given and the questionnaire has a sum."""
        return self.to_instrument().score(self.all_answers)


def ask(session: TrainingSession, slugs: Sequence[str], now: datetime) -> None:
    """Plan questionnaires for the end of a session, in the patient's language, each once.

    Raises InvalidSetting for one that is not there.
    """
    with transaction.atomic():
        for slug in slugs:
            instrument = find_instrument(slug, session.clinic_id, session.patient.language)
            QuestionnaireResponse.everywhere.get_or_create(
                session=session,
                slug=slug,
                defaults={"instrument": instrument.to_json(), "asked_at": now},
            )


def next_response(actor: Any, session: TrainingSession) -> QuestionnaireResponse | None:
    """Return the first questionnaire of a session that is not finished; None if there is none."""
    rows = QuestionnaireResponse.objects.visible_to(actor).filter(session=session)
    return rows.filter(finished_at=None).order_by("pk").first()


def answer(
    response: QuestionnaireResponse, number: int, value: int | None, now: datetime
) -> QuestionnaireResponse:
    """Store one answer, or None for a skipped question; the last one finishes it.

    A question that was answered before gets the new answer. Raises InvalidSetting for one that is
    not reached yet, a value off its scale, and a questionnaire that is finished.
    """
    with transaction.atomic():
        rows = QuestionnaireResponse.everywhere.select_for_update(no_key=True, of=("self",))
        stored = rows.get(pk=response.pk)
        if stored.finished_at is not None or not 0 <= number <= len(stored.answers):
            raise InvalidSetting(
                gettext("This question is not open. Load the page again: it shows the next one.")
            )
        instrument = stored.to_instrument()
        if value is not None:
            instrument.check_answer(number, value)
        stored.answers[number : number + 1] = [value]
        if len(stored.answers) == len(instrument.items):
            stored.finished_at = now
        stored.save(update_fields=["answers", "finished_at"])
    return stored


def stop(response: QuestionnaireResponse, now: datetime) -> None:
    """Finish a questionnaire: what was not reached stays unanswered."""
    rows = QuestionnaireResponse.everywhere.filter(pk=response.pk, finished_at=None)
    rows.update(finished_at=now)

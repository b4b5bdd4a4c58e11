"""Who must not know a study's arms, who may look early, who watches over harms."""

from __future__ import annotations

from typing import Any, ClassVar

from django.db import models
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import Allowed
from rehab.people.audit.row_digests import SealableModel
from rehab.people.models import User
from rehab.people.scope import Scope
from rehab.studies.models.study import Study


class StudyMark(SealableModel):
    """What an account is in a study besides its role, until ``ended_at``."""

    class Task(models.TextChoices):
        """What the mark allows or hides."""

        ASSESSOR = "assessor", _("Assesses, and must not know the arm")
        INTERIM = "interim", _("May look before the study is closed")
        MONITOR = "monitor", _("Monitors harms by arm")

    scope = Scope(clinic="study__clinic")
    # With the event, which is sealed, of who ended it.
    allowed_changes = (
        Allowed(
            ("ended_at",),
            "OLD.ended_at IS NULL AND EXISTS (SELECT 1 FROM rehab_studyevent e WHERE "
            "e.study_id = NEW.study_id AND e.kind = 'unmarked' AND e.at = NEW.ended_at)",
        ),
    )
    sealed_fields = ("study", "user", "task", "by", "at")

    study = models.ForeignKey(Study, on_delete=models.PROTECT, related_name="marks")
    user = models.ForeignKey(User, on_delete=models.PROTECT, related_name="study_marks")
    task = models.CharField(_("task"), max_length=8, choices=Task.choices)
    by = models.ForeignKey(User, on_delete=models.PROTECT, related_name="+", null=True)
    at = models.DateTimeField(default=timezone.now)
    ended_at = models.DateTimeField(null=True)

    class Meta(SealableModel.Meta):
        verbose_name = _("mark")
        ordering: ClassVar = ["pk"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["study", "user", "task"],
                condition=Q(ended_at=None),
                name="study_mark_holds_once",
            )
        ]

    def __str__(self) -> str:
        return f"{self.user}: {self.get_task_display()}"


def has_mark(study: Study, user: Any, task: StudyMark.Task) -> bool:
    """Return whether the account ``user`` has the mark ``task`` in a study now."""
    return study.marks.filter(user=user, task=task, ended_at=None).exists()

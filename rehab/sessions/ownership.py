"""Which server a clinic lives in: that process alone writes the logs of its sessions."""

from __future__ import annotations

from typing import ClassVar

from django.db import models

from rehab.people.models import Clinic
from rehab.people.scope import Scope, ScopedModel


class ClinicOwner(ScopedModel):
    """The process that has a clinic; each claim raises the epoch, which locks the old one out.

    A row of its own: a form that saves a clinic must not write an earlier owner back, and a commit,
    which locks this row, must not wait for a form.
    """

    scope = Scope(clinic="clinic")

    clinic = models.OneToOneField(
        Clinic, on_delete=models.CASCADE, primary_key=True, related_name="+"
    )
    owner = models.CharField(max_length=200, blank=True)  # empty: released
    epoch = models.PositiveIntegerField(default=0)

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["clinic"]
        indexes: ClassVar = [models.Index(fields=["owner"], name="clinic_by_owner")]

    def __str__(self) -> str:
        return f"{self.clinic}: {self.owner}"

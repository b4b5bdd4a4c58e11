"""Groups of the hospital's own sign-on, and what their members are here."""

from __future__ import annotations

from typing import ClassVar

from django.db import models
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from rehab.people.models.clinics import Clinic
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedModel


class SignOnGroup(ScopedModel):
    """A group that the hospital's sign-on names, with the clinic and role of its members."""

    scope = Scope(clinic="clinic", host=Q())

    name = models.CharField(
        _("group"), max_length=200, help_text=_("As the hospital's sign-on names it.")
    )
    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="sign_on_groups", verbose_name=_("clinic")
    )
    role = models.CharField(
        _("role"), max_length=16, choices=[one for one in Role.choices if one[0] != Role.HOST]
    )

    class Meta(ScopedModel.Meta):
        verbose_name = _("sign-on group")
        verbose_name_plural = _("sign-on groups")
        ordering: ClassVar = ["clinic", "name"]
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["name", "clinic"],
                name="sign_on_group_once_a_clinic",
                violation_error_message=_("This clinic has this group already."),
            )
        ]

    def __str__(self) -> str:
        return self.name

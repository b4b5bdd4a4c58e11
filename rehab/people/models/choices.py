"""What a patient's fields offer to choose from."""

from __future__ import annotations

from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.training.steps import Side

SIDES = [(Side.LEFT.value, _("Left")), (Side.RIGHT.value, _("Right"))]


class ScreenSide(models.TextChoices):
    """Where things are on the patient's page; for neglect and visual field loss."""

    RIGHT = "right", _("on the right (usual)")
    LEFT = "left", _("on the left")
    CENTER = "center", _("everything in the middle")
    IN_RIGHT = "in_right", _("everything in the right half")
    IN_LEFT = "in_left", _("everything in the left half")


class ScreenText(models.TextChoices):
    """The size of text on the patient's page."""

    NORMAL = "normal", _("normal")
    LARGE = "large", _("large")
    LARGEST = "largest", _("largest")


class Severity(models.TextChoices):
    """How severe the impairment of gait is, as the clinic judges it."""

    MILD = "mild", _("mild")
    MODERATE = "moderate", _("moderate")
    SEVERE = "severe", _("severe")


class BoardsConsent(models.TextChoices):
    """Which leaderboards a patient has agreed to stand on; each includes those before it."""

    OWN = "own", _("None: sees own sessions only")
    TOTAL = "total", _("Counts in totals, stands in no row")
    CLINIC = "clinic", _("Boards of this clinic")
    ACROSS = "across", _("Boards of this clinic and across clinics")


class EndReason(models.TextChoices):
    """Why a patient's program has ended."""

    DONE = "done", _("The program is complete")
    WISH = "wish", _("The patient wishes to stop")
    HEALTH = "health", _("Health")
    MOVED = "moved", _("Goes on elsewhere")
    OTHER = "other", _("Another reason")


class ErasureReason(models.TextChoices):
    """Why all that leads to a patient was erased."""

    ASKED = "asked", _("The patient asks for it")
    MISTAKE = "mistake", _("Was entered by mistake")
    RETENTION = "retention", _("Kept long enough")


# Nicknames in a demonstration, which takes no other ones.
DEMO_NAMES = ("Amber", "Basil", "Clover", "Dill", "Elder", "Fern", "Ginger", "Hazel", "Demo")

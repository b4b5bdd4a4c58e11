"""The admin's front page, and its models under headings that a PT understands."""

from __future__ import annotations

from typing import Any

from django.contrib.admin import AdminSite
from django.contrib.admin.apps import AdminConfig
from django.http import HttpRequest, HttpResponseRedirect
from django.shortcuts import redirect
from django.template.response import TemplateResponse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

# Each heading with its models and one line about each. Models without a row stand under "More".
HEADINGS = (
    (
        _("Patients & sessions"),
        {
            "Patient": _("Who walks: code, nickname, leg, what they agreed to."),
            "TrainingSession": _("Everything that was walked, to find and to read."),
        },
    ),
    (
        _("Feedback & protocols"),
        {
            "Preset": _("Set-ups for one tap: type, goal, minutes, protocol, robot."),
            "FeedbackType": _("What a step earns, and which words answer it."),
            "Protocol": _("The phases of a session: baseline, training, catch, washout."),
            "ComposedGesture": _("What the robot does, composed of moves."),
            "MeasureDefinition": _("What is trained: A2 and others, with their units."),
            "Questionnaire": _("Your own questions with scales, asked after a session."),
            "ClinicTest": _("Your own assessment forms, beside the standard tests."),
        },
    ),
    (
        _("Leaderboards"),
        {
            "Leaderboard": _("A leaderboard says what is compared, who sees it and when."),
        },
    ),
    (
        _("Places & devices"),
        {
            "Station": _("Places with a tablet, a source of steps and a robot."),
            "Device": _(
                "Tablets, sources of steps and robots, each with the token that it connects by."
            ),
        },
    ),
    (
        _("People"),
        {
            "User": _("Who works here, and what their role lets them do."),
            "SignOnGroup": _("Which clinic and role a group of the hospital’s sign-on gives."),
            "ApiToken": _("Tokens with which programs use the API."),
            "Endpoint": _("Programs that are told when a session ends, a patient falls, and more."),
            "OutboxMessage": _("What they were told, and what was refused."),
            "Clinic": _("Name, language, clock, second factor, how long data is kept."),
        },
    ),
    (
        _("Records"),
        {
            "AuditEntry": _("Who looked at what, took it out, or steered the robot."),
            "HistoryEntry": _("Who changed what of people and settings."),
        },
    ),
)
MORE = _("More")


class GarryAdminSite(AdminSite):
    """Django's admin with a dashboard as front page."""

    index_template = "admin/dashboard.html"
    enable_nav_sidebar = False  # replaced by our own on every page but the front page

    def get_app_list(
        self, request: HttpRequest, app_label: str | None = None
    ) -> list[dict[str, Any]]:
        """Return the models by heading instead of by alphabet, in the order of `HEADINGS`."""
        models = {
            model["object_name"]: model
            for app in super().get_app_list(request, app_label)
            for model in app["models"]
        }
        sections = [
            (heading, [models.pop(name) | {"about": rows[name]} for name in rows if name in models])
            for heading, rows in HEADINGS
        ]
        sections.append((MORE, [model | {"about": ""} for model in models.values()]))
        return [
            {
                "name": heading,
                "app_label": f"heading-{number}",
                "app_url": "",
                "has_module_perms": True,
                "models": section,
            }
            for number, (heading, section) in enumerate(sections)
            if section
        ]

    def index(self, request: HttpRequest, extra_context: Any = None) -> TemplateResponse:
        """Show the dashboard: of the clinic for its people, of the server for a host."""
        from rehab.people.access import user_of
        from rehab.people.roles import Role
        from rehab.people.server_status import server_status
        from rehab.sessions.reports.day.dashboard import dashboard_context

        user = user_of(request)
        now = timezone.now()
        context = server_status(user) if user.role == Role.HOST else dashboard_context(user, now)
        return super().index(request, {**context, **(extra_context or {})})

    def app_index(  # type: ignore[override]
        self, request: HttpRequest, app_label: str, extra_context: Any = None
    ) -> HttpResponseRedirect:
        """Redirect to the dashboard, which lists all models."""
        return redirect("admin:index")


class GarryAdminConfig(AdminConfig):
    """Django's admin application with our site."""

    default_site = "rehab.admin_site.GarryAdminSite"

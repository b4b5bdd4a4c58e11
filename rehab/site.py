"""The admin as one place: its front page, and its models under headings that a PT understands."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from django.contrib.admin import AdminSite
from django.contrib.admin.apps import AdminConfig
from django.http import HttpRequest, HttpResponseRedirect
from django.shortcuts import redirect
from django.template.response import TemplateResponse
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

# Model → heading, and one line that says what it is. What has no row here stands under "More".
PATIENTS, FEEDBACK = _("Patients & sessions"), _("Feedback & protocols")
BOARDS, PLACES = _("Leaderboards"), _("Places & devices")
PEOPLE, RECORDS, MORE = _("People"), _("Records"), _("More")
HEADINGS = {
    "Patient": (PATIENTS, _("Who walks: code, nickname, leg, what they agreed to.")),
    "TrainingSession": (PATIENTS, _("Everything that was walked, to find and to read.")),
    "Preset": (FEEDBACK, _("Set-ups for one tap: type, goal, minutes, protocol, robot.")),
    "FeedbackType": (FEEDBACK, _("What a step earns, and which words answer it.")),
    "Protocol": (FEEDBACK, _("The phases of a session: baseline, training, catch, washout.")),
    "Gesture": (FEEDBACK, _("What the robot does, composed of moves.")),
    "Measure": (FEEDBACK, _("What is trained: A2 and others, with their units.")),
    "Leaderboard": (BOARDS, _("What is compared, who sees it, and when.")),
    "Station": (PLACES, _("Places with a tablet, a source of steps and a robot.")),
    "Device": (PLACES, _("What dials in from a station, and the token it does so with.")),
    "User": (PEOPLE, _("Who works here, and what their role lets them do.")),
    "ApiToken": (PEOPLE, _("What lets programs read and steer.")),
    "Clinic": (PEOPLE, _("Name, language, clock, second factor, how long data is kept.")),
    "AuditEntry": (RECORDS, _("Who looked at what, took it out, or steered the robot.")),
    "HistoryEntry": (RECORDS, _("Who changed what of people and settings.")),
}


class GarrySite(AdminSite):
    """Django's admin with a dashboard in front."""

    index_template = "admin/dashboard.html"
    enable_nav_sidebar = False  # ours stands beside every page but the front one

    def get_app_list(
        self, request: HttpRequest, app_label: str | None = None
    ) -> list[dict[str, Any]]:
        """Give the models by heading instead of by alphabet."""
        found: dict[Any, list[tuple[int, dict[str, Any]]]] = defaultdict(list)
        order = list(HEADINGS)
        for app in super().get_app_list(request, app_label):
            for model in app["models"]:
                name = model["object_name"]
                heading, about = HEADINGS.get(name, (MORE, ""))
                place = order.index(name) if name in order else len(order)
                found[heading].append((place, model | {"about": about}))
        return [
            {
                "name": heading,
                "app_label": f"heading-{number}",
                "app_url": "",
                "has_module_perms": True,
                "models": [model for _place, model in sorted(found[heading], key=lambda m: m[0])],
            }
            for number, heading in enumerate((PATIENTS, FEEDBACK, BOARDS, PLACES, PEOPLE, MORE))
            if heading in found
        ]

    def index(self, request: HttpRequest, extra_context: Any = None) -> TemplateResponse:
        """Show the dashboard: a clinic's for its people, the server's for a host."""
        from rehab.people.access import person
        from rehab.people.roles import Role
        from rehab.people.server_status import look_at_server
        from rehab.sessions.reports.dashboard import dashboard_context

        user = person(request)
        now = timezone.now()
        told = look_at_server(user) if user.role == Role.HOST else dashboard_context(user, now)
        return super().index(request, {**told, **(extra_context or {})})

    def app_index(  # type: ignore[override]
        self, request: HttpRequest, app_label: str, extra_context: Any = None
    ) -> HttpResponseRedirect:
        """Lead to the dashboard, which lists all there is."""
        return redirect("admin:index")


class GarryAdmin(AdminConfig):
    """Makes it the admin that Django loads."""

    default_site = "rehab.site.GarrySite"

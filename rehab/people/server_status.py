"""The host's front page of the admin: clinics, accounts and the server. No patients."""

from __future__ import annotations

import shutil
from typing import Any

from django.conf import settings
from django.db import connection
from django.db.models import Count, Q
from django.utils.translation import gettext

from rehab.people.commands import command, garry_version
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.people.sign_in.first_start import count_pending_migrations

LOW_DISK = 2 * 2**30  # bytes; a year of a clinic's sessions takes about one GB


def server_status(user: User) -> dict[str, Any]:
    """Return the context of the host's front page."""
    clinics = Clinic.objects.visible_to(user).annotate(
        accounts=Count("users", filter=Q(users__is_active=True)),
        leads=Count("users", filter=Q(users__is_active=True, users__role=Role.LEAD)),
    )
    accounts = User.objects.visible_to(user)
    free = shutil.disk_usage(settings.DATA_DIR).free if settings.DATA_DIR.exists() else None
    pending = count_pending_migrations()
    alerts = [
        gettext("%(clinic)s has no lead. Give one of its accounts that role.") % {"clinic": clinic}
        for clinic in clinics
        if not clinic.leads
    ]
    if pending:
        alerts.append(
            gettext("The database lacks changes of this version: %(count)s. Run %(command)s.")
            % {"count": pending, "command": command("migrate")}
        )
    if free is not None and free < LOW_DISK:
        alerts.append(gettext("The disk is nearly full. Make room before sessions run."))
    return {
        "clinics": clinics,
        "accounts": accounts.filter(is_active=True).count(),
        "switched_off": accounts.filter(is_active=False).count(),
        "server_alerts": alerts,
        "server": {
            gettext("Version"): garry_version(),
            gettext("Database"): connection.display_name,
            gettext("Its tables"): gettext("up to date")
            if not pending
            else gettext("changes due: %(count)s") % {"count": pending},
            gettext("Free on the disk"): "–" if free is None else f"{free / 2**30:.1f} GB",
            gettext("Open to several clinics, by https"): gettext("yes")
            if settings.HOSTED
            else gettext("no"),
        },
    }

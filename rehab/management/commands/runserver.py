"""`manage.py runserver`: Django's development server, with the live path inside."""

from daphne.management.commands.runserver import Command as DaphneCommand

from rehab.sessions.live.server import LiveServer


class Command(DaphneCommand):  # type: ignore[misc]
    """Daphne's command with our server, in the process that really serves."""

    server_cls = LiveServer

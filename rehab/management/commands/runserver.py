"""`manage.py runserver`: daphne's development server, with the live sessions."""

from daphne.management.commands.runserver import Command as DaphneCommand

from rehab.sessions.live.daphne_server import LiveServer


class Command(DaphneCommand):  # type: ignore[misc]
    """Daphne's command, which runs our server in the process that serves."""

    server_cls = LiveServer

"""The application that Django loads."""

from django.apps import AppConfig
from django.db.models.signals import post_migrate


class RehabConfig(AppConfig):
    """GARRY's one application."""

    name = "rehab"
    verbose_name = "GARRY"
    default_auto_field = "django.db.models.BigAutoField"

    def ready(self) -> None:
        """Register the checks, the shared rows of every database, and who listens to changes."""
        from rehab import checks  # noqa: F401
        from rehab.boards.watching import watch
        from rehab.models import TRACKED
        from rehab.people.audit.history import track
        from rehab.sessions.feedback_text_updates import connect_signals
        from rehab.sessions.setup.defaults import install_defaults

        post_migrate.connect(install_defaults, sender=self)
        watch()
        track(*TRACKED)
        connect_signals()

"""The application that Django loads."""

from django.apps import AppConfig
from django.db.models.signals import post_migrate


class RehabConfig(AppConfig):
    """The one application of GARRY."""

    name = "rehab"
    verbose_name = "GARRY"
    default_auto_field = "django.db.models.BigAutoField"

    def ready(self) -> None:
        """Register checks, the shared rows of every database, and signal receivers."""
        from rehab import checks  # noqa: F401
        from rehab.boards.signals import connect_receivers
        from rehab.models import TRACKED
        from rehab.people.audit.history import track_models
        from rehab.sessions.feedback_text_updates import connect_signals
        from rehab.sessions.setup.defaults import install_defaults

        post_migrate.connect(install_defaults, sender=self)
        connect_receivers()
        track_models(*TRACKED)
        connect_signals()

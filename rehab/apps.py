"""The application that Django loads."""

from django.apps import AppConfig
from django.db.models.signals import post_migrate, pre_save


class RehabConfig(AppConfig):
    """The one application of GARRY."""

    name = "rehab"
    verbose_name = "GARRY"
    default_auto_field = "django.db.models.BigAutoField"

    def ready(self) -> None:
        """Register checks, the shared rows of every database, and signal receivers."""
        from django.contrib.auth.signals import user_logged_in, user_login_failed

        from rehab import checks  # noqa: F401
        from rehab.boards.signals import connect_receivers
        from rehab.exports.fhir.push import install_writer
        from rehab.models import TRACKED
        from rehab.patients import family
        from rehab.people.audit import append_only_triggers, sign_in_log
        from rehab.people.audit.history import track_models
        from rehab.people.models import User
        from rehab.people.sign_in import lockout, step_up
        from rehab.people.sign_in.factors.factors import Authenticator
        from rehab.people.sign_in.first_start import forget_first_password
        from rehab.people.sign_in.signed_in_browsers import note_browser
        from rehab.people.sign_in.tokens import revoke_with_account
        from rehab.sessions.feedback_text_updates import connect_signals
        from rehab.sessions.setup.default_protocols import install_defaults
        from rehab.studies import signals as studies

        post_migrate.connect(install_defaults, sender=self)
        post_migrate.connect(append_only_triggers.install, sender=self)
        connect_receivers()
        track_models(*TRACKED)
        sign_in_log.connect_receivers(Authenticator)
        user_logged_in.connect(note_browser)
        user_logged_in.connect(forget_first_password)
        user_login_failed.connect(lockout.record_lockout)
        pre_save.connect(revoke_with_account, sender=User)
        connect_signals()
        studies.connect_receivers()
        family.connect_receivers()
        step_up.connect_signals()
        install_writer()

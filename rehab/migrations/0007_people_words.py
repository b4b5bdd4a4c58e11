"""New names of models and fields; part of the next squash."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("rehab", "0006_rename_session_fields")]

    operations = [
        migrations.RemoveConstraint("ErasedOriginal", "erased_once_per_clinic"),
        migrations.RemoveConstraint("Patient", "patient_imported_once_per_clinic"),
        migrations.RemoveConstraint("LeaveTries", "leave_tries_once_a_screen"),
        migrations.RemoveConstraint("RecoveryCode", "recovery_code_once"),
        migrations.RemoveConstraint("TrainingSession", "session_imported_once_per_clinic"),
        migrations.RemoveIndex("HistoryEntry", "history_by_row"),
        migrations.RenameField("Patient", "original_id", "legacy_id"),
        migrations.RenameField("Patient", "ended_because", "end_reason"),
        migrations.RenameField("Patient", "erased_because", "erasure_reason"),
        migrations.RenameField("Clinic", "keep_months", "retention_months"),
        migrations.RenameField("Clinic", "keep_log_months", "log_retention_months"),
        migrations.RenameField("TrainingSession", "original_id", "legacy_id"),
        migrations.RenameField("Authenticator", "material", "credential"),
        migrations.RenameField("Authenticator", "count", "counter"),
        migrations.RenameField("RecoveryCode", "digest", "code_hash"),
        migrations.RenameField("HistoryEntry", "noun", "model_name"),
        migrations.RenameField("HistoryEntry", "row", "object_id"),
        migrations.RenameField("HistoryEntry", "values", "changes"),
        migrations.RenameModel("ErasedOriginal", "ImportTombstone"),
        migrations.RenameField("ImportTombstone", "mark", "id_hash"),
        migrations.RenameModel("LeaveTries", "PinAttempts"),
        migrations.RenameField("PinAttempts", "who", "screen"),
        migrations.RenameField("PinAttempts", "wrong", "failures"),
        migrations.RenameField("PinAttempts", "open_at", "locked_until"),
        migrations.AddIndex(
            "HistoryEntry",
            models.Index(fields=["model_name", "object_id"], name="history_by_row"),
        ),
        migrations.AddConstraint(
            "ImportTombstone",
            models.UniqueConstraint(
                fields=("clinic", "id_hash"), name="import_tombstone_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            "Patient",
            models.UniqueConstraint(
                fields=("clinic", "legacy_id"), name="patient_imported_once_per_clinic"
            ),
        ),
        migrations.AddConstraint(
            "PinAttempts",
            models.UniqueConstraint(
                fields=("station", "screen"), name="pin_attempts_once_per_screen"
            ),
        ),
        migrations.AddConstraint(
            "RecoveryCode",
            models.UniqueConstraint(fields=("user", "code_hash"), name="recovery_code_once"),
        ),
        migrations.AddConstraint(
            "TrainingSession",
            models.UniqueConstraint(
                fields=("clinic", "legacy_id"), name="session_imported_once_per_clinic"
            ),
        ),
    ]

"""Forget django-axes, which counted attempts to sign in, with its tables; log new codes."""

from typing import Any

from django.db import migrations, models
from django.db.migrations.recorder import MigrationRecorder

TABLES = (
    *("axes_accessattemptexpiration", "axes_accessattempt"),
    *("axes_accesslog", "axes_accessfailurelog"),
)


def forget_axes(apps: Any, schema_editor: Any) -> None:
    """Drop its tables, and forget that its migrations were applied: backups compare these."""
    for table in TABLES:
        schema_editor.execute(f"DROP TABLE IF EXISTS {table}")
    alias = schema_editor.connection.alias
    apps.get_model("contenttypes", "ContentType").objects.using(alias).filter(
        app_label="axes"
    ).delete()
    MigrationRecorder(schema_editor.connection).migration_qs.filter(app="axes").delete()


class Migration(migrations.Migration):
    dependencies = [
        ("auth", "0012_alter_user_first_name_max_length"),
        ("contenttypes", "0002_remove_content_type_name"),
        ("rehab", "0010_seals"),
    ]

    operations = [
        migrations.RunPython(forget_axes, migrations.RunPython.noop),
        migrations.AlterField(
            model_name="auditentry",
            name="act",
            field=models.CharField(
                choices=[
                    ("view", "Looked at"),
                    ("change", "Changed"),
                    ("export", "Took data out"),
                    ("backup", "Backed up"),
                    ("erase", "Erased"),
                    ("unlock", "Unlocked an account"),
                    ("factors", "Removed second factors"),
                    ("reset", "Confirmed a host's reset"),
                    ("sign_in", "Signed in"),
                    ("sign_in_failed", "Failed to sign in"),
                    ("lock_out", "Was locked out"),
                    ("sign_ins_ended", "Ended all sign-ins"),
                    ("factor_added", "Added a second factor"),
                    ("factor_removed", "Removed a second factor"),
                    ("recovery_codes", "Made new recovery codes"),
                    ("password", "Changed a password"),
                    ("token_use", "Used a token from a new network"),
                    ("refused", "Was refused"),
                    ("token", "Gave a new token"),
                    ("robot_stop", "Stopped the robot"),
                    ("robot_arm", "Armed the robot"),
                    ("robot_trial", "Tried a gesture on the robot"),
                ],
                max_length=16,
                verbose_name="what",
            ),
        ),
    ]

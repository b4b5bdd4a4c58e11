"""Resets by hosts, and what ends an account's sign-ins."""

import django.db.models.deletion
import django.db.models.manager
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0007_notes_of_falls"),
    ]

    operations = [
        migrations.AddField(
            model_name="user",
            name="sign_in_generation",
            field=models.PositiveIntegerField(default=0, editable=False),
        ),
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
        migrations.CreateModel(
            name="ResetRequest",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("asked_at", models.DateTimeField()),
                ("confirmed_at", models.DateTimeField(null=True)),
                (
                    "account",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "asked_by",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
                (
                    "confirmed_by",
                    models.ForeignKey(
                        null=True,
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to=settings.AUTH_USER_MODEL,
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
                "constraints": [
                    models.UniqueConstraint(
                        fields=("account", "asked_by"), name="reset_request_once_per_host"
                    )
                ],
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
    ]

"""The server that a clinic lives in; leases say whether their servers take clinics."""

from typing import Any

import django.db.models.deletion
import django.db.models.manager
from django.db import migrations, models


def rename(old: str, new: str) -> Any:
    """Return what renames the leases' column, on PostgreSQL, where they are."""

    def run(apps: Any, schema_editor: Any) -> None:
        if schema_editor.connection.vendor == "postgresql":
            schema_editor.execute(f"ALTER TABLE rehab_server RENAME COLUMN {old} TO {new}")

    return run


class Migration(migrations.Migration):
    dependencies = [("rehab", "0002_trust33")]

    operations = [
        migrations.CreateModel(
            name="ClinicOwner",
            fields=[
                (
                    "clinic",
                    models.OneToOneField(
                        on_delete=django.db.models.deletion.CASCADE,
                        primary_key=True,
                        related_name="+",
                        serialize=False,
                        to="rehab.clinic",
                    ),
                ),
                ("owner", models.CharField(blank=True, max_length=200)),
                ("epoch", models.PositiveIntegerField(default=0)),
            ],
            options={
                "ordering": ["clinic"],
                "indexes": [models.Index(fields=["owner"], name="clinic_by_owner")],
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
            },
            managers=[("everywhere", django.db.models.manager.Manager())],
        ),
        migrations.RemoveField(model_name="trainingsession", name="epoch"),
        migrations.RemoveField(model_name="trainingsession", name="owner"),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(
                condition=models.Q(("state", "running")),
                fields=["clinic"],
                name="running_session_by_clinic",
            ),
        ),
        migrations.RunPython(rename("shares", "ready"), rename("ready", "shares")),
    ]

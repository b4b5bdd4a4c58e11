"""Consent to boards says how far it goes, and who stands on boards is who agrees to it.

Where both had come apart, nobody stands where no consent holds, and a consent that a PT had taken
back by the patient's boards alone is withdrawn. Boards with such a patient are built anew.
"""

from typing import Any

import django.db.models.deletion
import django.db.models.manager
from django.db import migrations, models
from django.utils import timezone

import rehab.people.networks


def tell_levels(apps: Any, schema_editor: Any) -> None:
    Patient, Consent, Leaderboard, BoardCount = (
        apps.get_model("rehab", name)
        for name in ("Patient", "Consent", "Leaderboard", "BoardCount")
    )
    held = Consent._base_manager.filter(purpose="boards", withdrawn_at=None)
    for level in ("total", "clinic", "across"):
        held.filter(patient__boards=level).update(level=level)
    held.filter(patient__boards="own").update(withdrawn_at=timezone.now())
    apart = Patient._base_manager.exclude(boards="own").filter(simulated=False)
    if apart.exclude(pk__in=held.values("patient")).update(boards="own"):
        BoardCount._base_manager.all().delete()
        Leaderboard._base_manager.update(built_to=0)


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0003_carry_over_consent"),
    ]

    operations = [
        migrations.AddField(
            model_name="clinic",
            name="care_needs_consent",
            field=models.BooleanField(
                default=False,
                help_text="No session can be set up for a patient who has not agreed to care.",
                verbose_name="care needs consent",
            ),
        ),
        migrations.AddField(
            model_name="clinic",
            name="networks",
            field=models.TextField(
                blank=True,
                help_text="One a line, such as 192.168.1.0/24. From elsewhere a session is watched only with the patient's consent to remote view; say so in your words. Empty: from anywhere, and nobody is asked.",
                max_length=1000,
                validators=[rehab.people.networks.validate_networks],
                verbose_name="the clinic's own networks",
            ),
        ),
        migrations.AddField(
            model_name="consent",
            name="level",
            field=models.CharField(
                blank=True,
                choices=[
                    ("own", "None: sees own sessions only"),
                    ("total", "Counts in totals, stands in no row"),
                    ("clinic", "Boards of this clinic"),
                    ("across", "Boards of this clinic and across clinics"),
                ],
                max_length=8,
                verbose_name="how far",
            ),
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
            name="ErasedOriginal",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("mark", models.CharField(max_length=64)),
                (
                    "clinic",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.CASCADE,
                        related_name="+",
                        to="rehab.clinic",
                        verbose_name="clinic",
                    ),
                ),
            ],
            options={
                "abstract": False,
                "base_manager_name": "everywhere",
                "default_manager_name": "everywhere",
                "constraints": [
                    models.UniqueConstraint(
                        fields=("clinic", "mark"), name="erased_once_per_clinic"
                    )
                ],
            },
            managers=[
                ("everywhere", django.db.models.manager.Manager()),
            ],
        ),
        migrations.RunPython(tell_levels, migrations.RunPython.noop),
    ]

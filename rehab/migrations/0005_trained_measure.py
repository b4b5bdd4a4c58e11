"""A measure may lie in an extra value of a step and has a first goal; a preset names its measure."""

from __future__ import annotations

from typing import Any

import django.core.validators
import django.db.models.deletion
from django.apps.registry import Apps
from django.db import migrations, models
from django.db.backends.base.schema import BaseDatabaseSchemaEditor


def fill(apps: Apps, schema_editor: BaseDatabaseSchemaEditor) -> None:
    """Set A2's first goal, and make A2 the measure of all presets."""
    using = schema_editor.connection.alias
    model: Any = apps.get_model("rehab", "Measure")  # type: ignore[misc]  # renamed in 0025
    measures = model.everywhere.using(using)
    a2 = measures.filter(clinic=None, slug="a2").first()
    if a2 is None:  # a new database: shared rows are made after all migrations
        return
    measures.filter(pk=a2.pk).update(first_goal=3.9)
    apps.get_model("rehab", "Preset").everywhere.using(using).update(measure=a2)


class Migration(migrations.Migration):
    """The foreign key is required from 0006 on: PostgreSQL checks it at the end of this one."""

    dependencies = [("rehab", "0004_live_path")]

    operations = [
        migrations.AddField(
            model_name="measure",
            name="channel",
            field=models.CharField(
                blank=True,
                help_text="Name of the extra value in the source's steps that holds it. Left "
                "empty, it is the value of the step itself.",
                max_length=64,
                validators=[
                    django.core.validators.RegexValidator(
                        "^[A-Za-z0-9_.:-]{1,64}\\Z",
                        "Only letters, digits and . _ : - as sources send it.",
                    )
                ],
                verbose_name="channel",
            ),
        ),
        migrations.AddField(
            model_name="measure",
            name="first_goal",
            field=models.FloatField(
                blank=True,
                help_text="Offered where a patient has no goal yet; the middle where left empty.",
                null=True,
                verbose_name="first goal",
            ),
        ),
        migrations.AddField(
            model_name="preset",
            name="measure",
            field=models.ForeignKey(
                null=True,
                on_delete=django.db.models.deletion.CASCADE,
                related_name="presets",
                to="rehab.measure",
                verbose_name="measure",
            ),
        ),
        migrations.AlterField(
            model_name="preset",
            name="goal_by",
            field=models.CharField(
                choices=[("value", "value"), ("percent", "% of baseline")],
                default="value",
                max_length=8,
                verbose_name="goal is given as",
            ),
        ),
        migrations.AlterField(
            model_name="preset",
            name="goal_value",
            field=models.FloatField(
                blank=True, null=True, verbose_name="goal, in the measure's unit"
            ),
        ),
        migrations.RunPython(fill, migrations.RunPython.noop),
    ]

"""A preset names its measure."""

from __future__ import annotations

import django.db.models.deletion
from django.db import migrations, models


class Migration(migrations.Migration):
    """Follows the migration that gave each preset one."""

    dependencies = [("rehab", "0005_trained_measure")]

    operations = [
        migrations.AlterField(
            model_name="preset",
            name="measure",
            field=models.ForeignKey(
                on_delete=django.db.models.deletion.CASCADE,
                related_name="presets",
                to="rehab.measure",
                verbose_name="measure",
            ),
        ),
    ]

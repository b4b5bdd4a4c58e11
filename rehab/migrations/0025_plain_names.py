"""Rows that define a measure or gesture are named apart from the rules of training and robot."""

from django.db import migrations


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0024_valence_now"),
    ]

    operations = [
        migrations.RenameModel("Gesture", "ComposedGesture"),
        migrations.RenameModel("Measure", "MeasureDefinition"),
    ]

"""Languages are the settings': another one takes no migration."""

from django.db import migrations, models

import rehab.people.models.clinics


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0018_demo_walker"),
    ]

    operations = [
        migrations.AlterField(
            model_name="clinic",
            name="language",
            field=models.CharField(
                choices=rehab.people.models.clinics.language_choices,
                default="en",
                max_length=8,
                verbose_name="language",
            ),
        ),
        migrations.AlterField(
            model_name="patient",
            name="language",
            field=models.CharField(
                choices=rehab.people.models.clinics.language_choices,
                default="en",
                max_length=8,
                verbose_name="language",
            ),
        ),
        migrations.AlterField(
            model_name="user",
            name="language",
            field=models.CharField(
                blank=True,
                choices=rehab.people.models.clinics.language_choices,
                help_text="Of the pages that this account opens; empty: the clinic's.",
                max_length=8,
                verbose_name="language",
            ),
        ),
    ]

"""Which steps came too late to be shown as live, for servers that follow a session."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0002_server_leases"),
    ]

    operations = [
        migrations.AddField(
            model_name="step",
            name="late",
            field=models.BooleanField(
                db_default=False,
                help_text="It came too late to be shown as live.",
                verbose_name="late",
            ),
        ),
    ]

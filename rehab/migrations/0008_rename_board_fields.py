"""Rename board fields: stake to points_at_stake, moment to occasion."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("rehab", "0007_people_words")]

    operations = [
        migrations.RenameField("boardentry", "stake", "points_at_stake"),
        migrations.RenameField("leaderboard", "moment", "occasion"),
        migrations.AlterField(
            "boardentry", "figure", models.IntegerField(help_text="As it is shown: a whole number.")
        ),
        migrations.AlterField(
            "boardentry",
            "points_at_stake",
            models.IntegerField(
                help_text="The points that could be kept, where points can only be lost.", null=True
            ),
        ),
        migrations.AlterField(
            "boardentry",
            "stale_on",
            models.DateField(help_text="The day from which it is out of date.", null=True),
        ),
        migrations.AlterField(
            "leaderboard",
            "built_to",
            models.BigIntegerField(
                editable=False,
                help_text="Key of the last patient whose rows are built; empty when all are.",
                null=True,
            ),
        ),
    ]

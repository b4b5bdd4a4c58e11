"""What the live path compares and follows: each log's last step, boards due, robots stopped."""

import django.db.models.deletion
from django.db import migrations, models

LAST_NUMBERS = """
UPDATE rehab_trainingsession SET last_number = COALESCE(
    (SELECT MAX(number) FROM rehab_step WHERE session_id = rehab_trainingsession.id), 0
)
"""
ROBOT_ORDERS = """
UPDATE rehab_station SET robot_stopped = COALESCE((
    SELECT event.kind = 'robot_stop' FROM rehab_sessionevent AS event
    JOIN rehab_trainingsession AS session ON session.id = event.session_id
    WHERE session.station_id = rehab_station.id AND event.kind IN ('robot_stop', 'robot_arm')
    ORDER BY event.id DESC LIMIT 1
), FALSE)
"""


class Migration(migrations.Migration):
    dependencies = [
        ("rehab", "0003_audit_of_sign_ins"),
    ]

    operations = [
        migrations.AddField(
            model_name="trainingsession",
            name="last_number",
            field=models.PositiveIntegerField(default=0, editable=False),
        ),
        migrations.AddField(
            model_name="trainingsession",
            name="checkpoint",
            field=models.JSONField(editable=False, null=True),
        ),
        migrations.AddField(
            model_name="trainingsession",
            name="boards_due",
            field=models.BooleanField(default=False, editable=False),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(fields=["station", "state"], name="session_by_station_and_state"),
        ),
        migrations.AlterField(
            model_name="trainingsession",
            name="station",
            field=models.ForeignKey(
                blank=True,
                db_index=False,
                null=True,
                on_delete=django.db.models.deletion.SET_NULL,
                related_name="sessions",
                to="rehab.station",
                verbose_name="station",
            ),
        ),
        migrations.AlterField(
            model_name="trainingsession",
            name="owner",
            field=models.CharField(blank=True, db_index=True, editable=False, max_length=200),
        ),
        migrations.AddIndex(
            model_name="trainingsession",
            index=models.Index(
                condition=models.Q(("boards_due", True)), fields=["id"], name="session_boards_due"
            ),
        ),
        migrations.AlterField(
            model_name="step",
            name="session",
            field=models.ForeignKey(
                db_index=False,
                on_delete=django.db.models.deletion.PROTECT,
                related_name="steps",
                to="rehab.trainingsession",
                verbose_name="session",
            ),
        ),
        migrations.AddField(
            model_name="station",
            name="robot_stopped",
            field=models.BooleanField(default=False, editable=False, verbose_name="robot stopped"),
        ),
        migrations.RunSQL(ROBOT_ORDERS, migrations.RunSQL.noop),
        migrations.RunSQL(LAST_NUMBERS, migrations.RunSQL.noop),
    ]

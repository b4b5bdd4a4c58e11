"""Of a fall it can be noted how badly it hurt, and that it was none."""

from typing import ClassVar

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies: ClassVar = [
        ("rehab", "0006_preset_measure_required"),
    ]

    operations: ClassVar = [
        migrations.AlterField(
            model_name="sessionevent",
            name="kind",
            field=models.CharField(
                choices=[
                    ("start", "start"),
                    ("pause", "pause"),
                    ("resume", "resume"),
                    ("finish", "finish"),
                    ("abort", "abort"),
                    ("goal", "goal"),
                    ("gain", "gain"),
                    ("phase", "phase"),
                    ("activation_threshold", "activation threshold"),
                    ("robot_intensity", "robot intensity"),
                    ("valence", "feedback type"),
                    ("feedback_text", "words"),
                    ("words_shown", "words shown"),
                    ("chart_style", "chart style"),
                    ("robot_stop", "robot stop"),
                    ("robot_arm", "robot arm"),
                    ("robot_decision", "robot decision"),
                    ("robot_gesture", "robot gesture"),
                    ("rest", "rest"),
                    ("pain", "pain"),
                    ("dizziness", "dizziness"),
                    ("near_fall", "near fall"),
                    ("fall", "fall"),
                    ("fall_severity", "hurt by the fall"),
                    ("fall_withdrawn", "it was no fall"),
                    ("handrail", "handrail"),
                    ("verbal_cue", "verbal cue"),
                    ("borg", "borg"),
                ],
                max_length=32,
                verbose_name="kind",
            ),
        ),
    ]

"""Points break no ties between feedback types; boards with points are built anew by today's rules.

A tie-breaker that compared points of different types, or points of a type that has none, goes: the
earlier date decides. The help text says what freezing is.
"""

from typing import Any

from django.db import migrations, models

POINTS = ("score", "points_per_100_steps")


def settle(apps: Any, schema_editor: Any) -> None:
    Leaderboard, BoardCount = (
        apps.get_model("rehab", name) for name in ("Leaderboard", "BoardCount")
    )
    with_points = models.Q(metric__in=POINTS) | models.Q(tie_breaker__in=POINTS)
    boards = Leaderboard._base_manager.filter(with_points).exclude(among="self")
    for board in boards:
        chosen = set(board.valences)
        mixed = board.types == "all" or (board.types == "chosen" and len(chosen) > 1)
        pointless = board.types == "chosen" and chosen == {"explicit"}
        unsettled = board.tie_breaker in POINTS and (mixed or pointless)
        Leaderboard._base_manager.filter(pk=board.pk).update(
            tie_breaker="" if unsettled else board.tie_breaker,
            built_to=0,  # the server builds what it finds so
        )
        BoardCount._base_manager.filter(board=board).delete()


class Migration(migrations.Migration):
    dependencies = [("rehab", "0004_what_was_agreed_to")]

    operations = [
        migrations.AlterField(
            model_name="leaderboard",
            name="frozen_on",
            field=models.DateField(
                blank=True,
                help_text=(
                    "For a report: the board stays as it was at the end of this day. Nobody enters "
                    "it afterwards, and who leaves the boards leaves it."
                ),
                null=True,
                verbose_name="frozen on",
            ),
        ),
        migrations.RunPython(settle, migrations.RunPython.noop),
    ]

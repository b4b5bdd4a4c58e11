"""Admin of leaderboards."""

from django.contrib import admin

from rehab.boards.models import Leaderboard
from rehab.people.admin_base import ScopedAdmin


@admin.register(Leaderboard)
class LeaderboardAdmin(ScopedAdmin):
    """Leaderboards of the clinic."""

    list_display = ("name", "among", "types", "metric", "period", "active")
    fieldsets = (
        (None, {"fields": ("name", "active", "among", "entry", "mean_of")}),
        (
            "What counts",
            {"fields": ("types", "valences", "metric", "min_valid_strides", "include_simulated")},
        ),
        ("When", {"fields": ("period", "period_from", "period_to", "moment")}),
        (
            "How it looks",
            {"fields": ("display", "top_n", "ties", "show_ranks", "names", "min_participants")},
        ),
    )

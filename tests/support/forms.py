"""Forms as browsers send them."""

from __future__ import annotations

from typing import Any

from rehab.feedback.admin import initial_bands
from rehab.sessions.setup.protocol_models import Protocol
from rehab.stations.models import Station
from rehab.training.valences import VALENCES


def feedback_form(slug: str, **changes: Any) -> dict[str, Any]:
    """Return a feedback type's form as it is when the type is taken over."""
    usual = VALENCES[slug]
    rows = initial_bands(slug)
    fields: dict[str, Any] = {
        "slug": slug,
        "bands-TOTAL_FORMS": len(rows),
        "bands-INITIAL_FORMS": 0,
    }
    for index, row in enumerate(rows):
        fields |= {f"bands-{index}-{name}": value for name, value in row.items()}
    if usual.hit_points:
        fields["hit_points"] = usual.hit_points
    if usual.miss_points:
        fields["miss_points"] = usual.miss_points
    fields |= {"cue_above": usual.cue.above or "", "cue_below": usual.cue.below or ""}
    return fields | changes


def gesture_form(name: str, steps: list[dict[str, Any]], stored: int = 0) -> dict[str, Any]:
    """Return a gesture's form as a browser fills it: what is not named is as suggested."""
    form: dict[str, Any] = {
        "name": name,
        "steps-TOTAL_FORMS": len(steps),
        "steps-INITIAL_FORMS": stored,
    }
    suggested = {"position": "", "turn_deg": 0, "forward_m": 0, "hold_s": 0, "pace": 1}
    for index, step in enumerate(steps):
        for part, value in (suggested | {"within_s": ""} | step).items():
            form[f"steps-{index}-{part}"] = value
    return form


def session_form(station: Station) -> dict[str, Any]:
    """Return what the set-up's form sends for a session at a station."""
    return {
        "valence": "binary",
        "goal_by": "value",
        "goal_value": "3",
        "source": "live",
        "trained_side": "left",
        "robot": "off",
        "robot_above": "(usual)",
        "robot_below": "(usual)",
        "protocol": Protocol.everywhere.get(name="Training only", clinic=None).pk,
        "station": station.pk,
    }

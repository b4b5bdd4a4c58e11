"""The general layout: time and value, and optional columns for the rest."""

from __future__ import annotations

import re

from rehab.sources.recording.layout import Layout, make_row_phase
from rehab.sources.recording.table import Row, quote
from rehab.training.phases import PHASE_KINDS, Phase
from rehab.training.steps import InvalidReason

_REASON = re.compile(r"[a-z][a-z0-9_]{0,39}", re.ASCII)


def _read_plain_reasons(row: Row) -> tuple[str, ...]:
    valid = row.flag_in("valid")
    reasons = tuple(row.text("reason").split())
    for reason in reasons:
        if not _REASON.fullmatch(reason):
            raise row.error(
                f"{quote(reason)} is no reason code. Write lower-case words such as flagged or "
                "force_lost, with blanks between several.",
                "reason",
            )
    if valid and reasons:
        raise row.error("a valid stride has no reason. Write valid 0 or no reason.", "valid")
    if valid is False and not reasons:
        return (InvalidReason.FLAGGED,)
    # Scoring finds a missing value by itself; given twice, it would count as another fault.
    missing = row.number_in("value") is None
    return tuple(reason for reason in reasons if not (missing and reason == InvalidReason.MISSING))


def _read_plain_phase(row: Row) -> Phase:
    slug = row.text("kind")
    if not slug and not row.has("kind") and not row.has("phase"):
        slug = "training"
    kind = PHASE_KINDS.get(slug)
    if kind is None:
        raise row.error(
            f"{quote(slug)} does not say what the phase is for. Write one of "
            f"{', '.join(PHASE_KINDS)}.",
            "kind",
        )
    feedback = row.flag_in("feedback")
    gain = row.number_in("gain")
    return make_row_phase(
        row,
        "gain",
        kind.slug,
        row.text("phase") or kind.label,
        kind.feedback if feedback is None else feedback,
        1.0 if gain is None else gain,
    )


PLAIN = Layout(
    name="plain",
    required=("time_s", "value"),
    number="number",
    time_s="time_s",
    side="side",
    value="value",
    goal="goal",
    shown="shown",
    hit="hit",
    read_reasons=_read_plain_reasons,
    read_phase=_read_plain_phase,
    other=("valid", "reason", "phase", "kind", "feedback", "gain"),
)

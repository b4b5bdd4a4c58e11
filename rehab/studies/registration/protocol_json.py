"""The registered study as data: all versions, every change of outcomes, how it allocates."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import datetime
from typing import Any

from rehab.studies.allocation.draws import RULE
from rehab.studies.models import Study, StudyState
from rehab.studies.registration.allocation_secret import unseal
from rehab.studies.registration.estimands import estimands
from rehab.studies.registration.outcome_changes import outcome_changes

DATES = frozenset({"registered_at", "closed_at", "at"})


def write_json(study: Study, *, has_dates: bool = True) -> str:
    """Return a registered study with all its versions; of a closed one also the seed.

    ``has_dates``: whether it says when; without, dates of participants cannot be told from it.
    """
    protocol: dict[str, Any] = {
        "registered_at": study.registered_at,
        "closed_at": study.closed_at,
        "draw_rule": RULE,
        "outcome_changes": [change.to_row() for change in outcome_changes(study)],
        "versions": [
            {
                "number": version.number,
                "at": version.at,
                "reason": version.reason,
                "sha256": version.digest,
                "needs_consent": version.needs_consent,
                "estimands": list(estimands(version.document)),
                "study": version.document,
            }
            for version in study.versions.all()
        ],
    }
    if study.state == StudyState.CLOSED and study.sealed:
        protocol["allocation_secret"] = asdict(unseal(study.sealed))
    if not has_dates:
        for part in (protocol, *protocol["versions"], *protocol["outcome_changes"]):
            for name in DATES & part.keys():
                part[name] = None
    return json.dumps(protocol, indent=2, ensure_ascii=False, default=datetime.isoformat) + "\n"

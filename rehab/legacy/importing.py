"""Importing participants and sessions of an original GARRY into a clinic."""

from __future__ import annotations

from collections import Counter
from datetime import timedelta
from zoneinfo import ZoneInfo

from django.utils import timezone

from rehab.boards.snapshots import freeze_boards
from rehab.legacy.database import LegacyDatabase, LegacySession
from rehab.people.consent.tombstones import is_reimport_blocked
from rehab.people.models import Clinic, Patient
from rehab.sessions.log import SessionMetric, figures_stored
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.protocol_models import MeasureDefinition
from rehab.training.changes import State
from rehab.training.goals import GoalRule
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import VALENCES, find_valence

SOURCE = "Original GARRY"


class Importer:
    """Imports a file's rows into a clinic, each once, and counts the outcomes."""

    def __init__(self, clinic: Clinic, database: LegacyDatabase) -> None:
        self.clinic = clinic
        self.database = database
        self.imported: Counter[str] = Counter()
        self.existing: Counter[str] = Counter()
        self.erased: Counter[str] = Counter()
        self.errors = {
            "participants": dict(database.participant_errors),
            "sessions": dict(database.session_errors),
        }
        self._measure = MeasureDefinition.everywhere.get(clinic=None, slug=A2.slug)
        self._zone = ZoneInfo(clinic.time_zone)

    def run(self) -> None:
        """Import everything that can be, except for participants who were erased here.

        Boards whose last day is over are stored first: no session that comes later is on them.
        """
        freeze_boards([self.clinic.pk], timezone.now())
        erased = {
            pk for pk in self.database.participants if is_reimport_blocked(self.clinic.pk, pk)
        }
        self.erased["participants"] = len(erased)
        patients = {
            pk: self._import_participant(pk)
            for pk in self.database.participants
            if pk not in erased
        }
        for legacy in self.database.sessions:
            if legacy.participant in erased:
                self.erased["sessions"] += 1
                continue
            patient = patients[legacy.participant]
            if patient is None:
                message = f"participant {legacy.participant} could not be taken over"
                self.errors["sessions"][legacy.id] = message
            else:
                self._import_session(legacy, patient)

    def _import_participant(self, pk: int) -> Patient | None:
        own = Patient.everywhere.filter(clinic=self.clinic)
        patient = own.filter(legacy_id=pk).first()
        if patient is not None:
            self.existing["participants"] += 1
            return patient
        if own.filter(code=f"{pk}").exists():
            self.errors["participants"][pk] = (
                f"another patient of {self.clinic} has the code {pk}. Give that one another code"
            )
            return None
        self.imported["participants"] += 1
        return Patient.everywhere.create(
            clinic=self.clinic,
            code=f"{pk}",
            nickname=f"P{pk}",
            language=self.clinic.language,
            legacy_id=pk,
        )

    def _import_session(self, legacy: LegacySession, patient: Patient) -> None:
        existing = TrainingSession.everywhere.filter(
            clinic=self.clinic, legacy_id=legacy.id
        ).first()
        if existing is not None and existing.legacy_row == legacy.row:
            self.existing["sessions"] += 1
            return
        if existing is not None:
            self.errors["sessions"][legacy.id] = (
                "a session with this id but other contents was imported before. If this is "
                "another file, import it into a clinic of its own"
            )
            return
        try:
            self._store(legacy, patient)
        except InvalidSetting as problem:
            self.errors["sessions"][legacy.id] = str(problem).removesuffix(".")
        else:
            self.imported["sessions"] += 1

    def _store(self, legacy: LegacySession, patient: Patient) -> None:
        """Store a finished session without steps. Raises InvalidSetting for an invalid goal."""
        plan = SessionPlan(
            measure=self._measure.to_rule(),
            valence=find_valence(legacy.valence),
            phases=(make_phase("training"),),
            trained_side=Side.LEFT,  # unknown, and without steps it has no effect
            goal=GoalRule(value=legacy.goal),
        )
        start = legacy.start.replace(tzinfo=self._zone)
        session = TrainingSession.everywhere.create(
            clinic=self.clinic,
            patient=patient,
            measure=self._measure,
            created_at=start,
            valence=legacy.valence,
            trained_side="",
            source=SOURCE,
            plan=plan.to_json(),
            state=State.FINISHED.value,
            goal=legacy.goal,
            started_at=start,
            ended_at=start + timedelta(seconds=legacy.duration_s),
            active_s=legacy.duration_s,
            legacy_id=legacy.id,
            legacy_row=legacy.row,
        )
        if plan.valence.has_points and legacy.score is not None:
            SessionMetric.everywhere.create(session=session, slug="score", value=legacy.score)
            figures_stored.send(SessionMetric, patients={patient.pk})

    @property
    def is_complete(self) -> bool:
        """Whether every row was imported, now or before."""
        return not any(self.errors.values())

    def report(self) -> list[str]:
        """Return the lines of a report: the counts of each outcome, and the errors with reasons."""
        read = {
            "participants": len(self.database.participants) + len(self.database.participant_errors),
            "sessions": len(self.database.sessions) + len(self.database.session_errors),
        }
        lines = [f"{'':14}{'read':>6}{'taken over':>12}{'here before':>13}{'could not':>11}"]
        lines += [
            f"{noun:14}{read[noun]:6}{self.imported[noun]:12}{self.existing[noun]:13}{len(errors):11}"
            for noun, errors in self.errors.items()
        ]
        lines += [
            f"  {noun.removesuffix('s')} {pk}: {message}."
            for noun, errors in self.errors.items()
            for pk, message in sorted(
                errors.items(), key=lambda item: (isinstance(item[0], str), item)
            )
        ]
        return lines + self._omissions()

    def _omissions(self) -> list[str]:
        without_points = sum(
            not VALENCES[legacy.valence].has_points for legacy in self.database.sessions
        )
        lines = [
            "Left out: strides and the trained leg, which the original did not keep.",
        ]
        if self.database.name_count:
            lines.append(
                f"Left out: {self.database.name_count} name(s). GARRY keeps no real names: "
                "patients are called P1, P2, … until a therapist gives them a nickname."
            )
        if self.erased["participants"]:
            lines.append(
                f"Left out: {self.erased['participants']} participant(s) who were erased here, and "
                f"their {self.erased['sessions']} session(s)."
            )
        if without_points:
            lines.append(
                f"Left out: the score of {without_points} explicit session(s). Explicit feedback "
                "has none."
            )
        return lines

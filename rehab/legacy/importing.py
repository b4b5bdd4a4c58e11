"""Importing participants and sessions of an original GARRY into a clinic."""

from __future__ import annotations

from collections import Counter
from datetime import timedelta
from zoneinfo import ZoneInfo

from rehab.legacy.database import LegacyDatabase, LegacySession
from rehab.people.consent.tombstones import is_kept_away
from rehab.people.models import Clinic, Patient
from rehab.sessions.log import SessionMetric
from rehab.sessions.models import TrainingSession
from rehab.sessions.protocols import Measure
from rehab.training.changes import State
from rehab.training.goals import GoalRule
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import make_phase
from rehab.training.plans import SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import VALENCES, find_valence

SOURCE = "LegacyDatabase GARRY"


class Importer:
    """Takes a file's rows over into a clinic, each once; keeps count of what became of them."""

    def __init__(self, clinic: Clinic, original: LegacyDatabase) -> None:
        self.clinic = clinic
        self.original = original
        self.taken: Counter[str] = Counter()
        self.here: Counter[str] = Counter()
        self.erased: Counter[str] = Counter()
        self.faults = {
            "participants": dict(original.nameless),
            "sessions": dict(original.faults),
        }
        self._measure = Measure.everywhere.get(clinic=None, slug=A2.slug)
        self._zone = ZoneInfo(clinic.time_zone)

    def run(self) -> None:
        """Take over all that can be; whoever was erased here stays away."""
        away = {pk for pk in self.original.participants if is_kept_away(self.clinic.pk, pk)}
        self.erased["participants"] = len(away)
        patients = {
            pk: self._take_participant(pk) for pk in self.original.participants if pk not in away
        }
        for found in self.original.sessions:
            if found.participant in away:
                self.erased["sessions"] += 1
                continue
            patient = patients[found.participant]
            if patient is None:
                words = f"participant {found.participant} could not be taken over"
                self.faults["sessions"][found.id] = words
            else:
                self._take_session(found, patient)

    def _take_participant(self, pk: int) -> Patient | None:
        own = Patient.everywhere.filter(clinic=self.clinic)
        patient = own.filter(original_id=pk).first()
        if patient is not None:
            self.here["participants"] += 1
            return patient
        if own.filter(code=f"{pk}").exists():
            self.faults["participants"][pk] = (
                f"another patient of {self.clinic} has the code {pk}. Give that one another code"
            )
            return None
        self.taken["participants"] += 1
        return Patient.everywhere.create(
            clinic=self.clinic,
            code=f"{pk}",
            nickname=f"P{pk}",
            language=self.clinic.language,
            original_id=pk,
        )

    def _take_session(self, found: LegacySession, patient: Patient) -> None:
        before = TrainingSession.everywhere.filter(clinic=self.clinic, original_id=found.id).first()
        if before is not None and before.legacy_row == found.row:
            self.here["sessions"] += 1
            return
        if before is not None:
            self.faults["sessions"][found.id] = (
                "a session with this id but other contents was imported before. If this is "
                "another file, import it into a clinic of its own"
            )
            return
        try:
            self._store(found, patient)
        except InvalidSetting as problem:
            self.faults["sessions"][found.id] = str(problem).removesuffix(".")
        else:
            self.taken["sessions"] += 1

    def _store(self, found: LegacySession, patient: Patient) -> None:
        """Store a finished session without steps. Raises InvalidSetting for a goal that is none."""
        plan = SessionPlan(
            measure=self._measure.to_rule(),
            valence=find_valence(found.valence),
            phases=(make_phase("training"),),
            trained_side=Side.LEFT,  # not known, and without a step it scores nothing
            goal=GoalRule(value=found.goal),
        )
        start = found.start.replace(tzinfo=self._zone)
        session = TrainingSession.everywhere.create(
            clinic=self.clinic,
            patient=patient,
            measure=self._measure,
            created_at=start,
            valence=found.valence,
            trained_side="",
            source=SOURCE,
            plan=plan.to_json(),
            state=State.FINISHED.value,
            goal=found.goal,
            started_at=start,
            ended_at=start + timedelta(seconds=found.duration_s),
            active_s=found.duration_s,
            original_id=found.id,
            legacy_row=found.row,
        )
        if plan.valence.has_points and found.score is not None:
            SessionMetric.everywhere.create(session=session, slug="score", value=found.score)

    @property
    def is_whole(self) -> bool:
        """Whether nothing had to be left behind."""
        return not any(self.faults.values())

    def report(self) -> list[str]:
        """Tell what was read, what became of it, and why some of it could not be taken."""
        read = {
            "participants": len(self.original.participants) + len(self.original.nameless),
            "sessions": len(self.original.sessions) + len(self.original.faults),
        }
        lines = [f"{'':14}{'read':>6}{'taken over':>12}{'here before':>13}{'could not':>11}"]
        lines += [
            f"{noun:14}{read[noun]:6}{self.taken[noun]:12}{self.here[noun]:13}{len(faults):11}"
            for noun, faults in self.faults.items()
        ]
        lines += [
            f"  {noun.removesuffix('s')} {pk}: {words}."
            for noun, faults in self.faults.items()
            for pk, words in sorted(faults.items(), key=lambda one: (isinstance(one[0], str), one))
        ]
        return lines + self._left_out()

    def _left_out(self) -> list[str]:
        unpaid = sum(not VALENCES[one.valence].has_points for one in self.original.sessions)
        lines = [
            "Left out: strides and the trained leg, which the original did not keep.",
        ]
        if self.original.named:
            lines.append(
                f"Left out: {self.original.named} name(s). GARRY keeps no real names: patients are "
                "called P1, P2, … until a therapist gives them a nickname."
            )
        if self.erased["participants"]:
            lines.append(
                f"Left out: {self.erased['participants']} participant(s) who were erased here, and "
                f"their {self.erased['sessions']} session(s)."
            )
        if unpaid:
            lines.append(
                f"Left out: the score of {unpaid} explicit session(s). Explicit feedback has none."
            )
        return lines

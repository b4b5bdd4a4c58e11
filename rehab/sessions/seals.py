"""Seals on the logs of sessions: a chain of digests for each clinic, over steps and events.

Rows are sealed as they are stored, some minutes after they came in and to the end once a session
has ended, apart from the live path: what is read back is proven, and nobody who walks waits.
Digests name rows by their place in the session, so that they hold on any database.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from datetime import datetime
from typing import Any, ClassVar

import msgspec
from django.db import IntegrityError, models, transaction
from django.db.models import F, Max, Q
from django.utils import timezone

from rehab.people.append_only import Allowed, AppendOnlyModel
from rehab.people.audit.moves import Translate, moves_of, original_keys, same_key
from rehab.people.audit.row_digests import with_floats
from rehab.people.field_policy import personal_fields, retained
from rehab.people.models import Clinic, Patient, User
from rehab.people.scope import Scope
from rehab.sessions.log import PATIENT_IS_ERASED, SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.step_columns import STEP_COLUMNS
from rehab.training.changes import OPEN_STATES

BATCH_ROWS = 500
PAUSE_S = 0.05  # between batches in a server: its threads share one interpreter
STEP_FIELDS = [column.field for column in STEP_COLUMNS]
EVENT_FIELDS = ("by_id", "after_number", "kind", "old", "value", "at", "data")
_to_json = msgspec.json.Encoder(order="sorted").encode
SERVERS_OWN = retained("digests, without the values that they prove", shown=False, research=False)


class SessionSeal(AppendOnlyModel):
    """Steps and events of a session with their digest, which includes the clinic's seal before.

    Steps are named by their numbers, events by their places from 1 on; a range that ends before it
    begins is empty. ``replaced_at``: when words in the events were erased with their patient; a
    later seal has them as they are since, and this one proves the steps alone.
    """

    scope = Scope(clinic="clinic")
    allowed_changes = (
        Allowed(
            ("replaced_at",),
            f"OLD.replaced_at IS NULL AND NEW.replaced_at IS NOT NULL AND {PATIENT_IS_ERASED}",
        ),
    )

    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="+")
    number = models.PositiveIntegerField()
    moves = models.PositiveIntegerField(default=0)  # that the clinic had made when it was sealed
    session = models.ForeignKey(TrainingSession, on_delete=models.PROTECT, related_name="seals")
    first_step = models.PositiveIntegerField()
    last_step = models.PositiveIntegerField()
    first_event = models.PositiveIntegerField()
    last_event = models.PositiveIntegerField()
    steps = models.CharField(max_length=64)
    events = models.CharField(max_length=64)
    previous = models.CharField(max_length=64, blank=True)
    digest = models.CharField(max_length=64)
    sealed_at = models.DateTimeField(default=timezone.now)
    replaced_at = models.DateTimeField(null=True)

    personal = personal_fields(
        {
            "clinic number moves session first_step last_step first_event last_event": SERVERS_OWN,
            "steps events previous digest sealed_at replaced_at": SERVERS_OWN,
        }
    )

    class Meta(AppendOnlyModel.Meta):
        verbose_name = "seal of a session"
        ordering: ClassVar = ["clinic", "number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "number"], name="sessions_sealed_in_order")
        ]

    def __str__(self) -> str:
        return f"{self.clinic_id}: {self.number}"

    def compute_digest(self, original: Translate = same_key) -> str:
        """Return the digest of what it covers behind the previous seal."""
        owners = original(Clinic, self.clinic_id), original(TrainingSession, self.session_id)
        ranges = self.first_step, self.last_step, self.first_event, self.last_event
        parts = (self.previous, self.number, *owners, *ranges, self.steps, self.events)
        return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()

    def find_changes(self, original: Translate) -> Iterator[str]:
        """Yield what is no longer as it was sealed."""
        first, last = self.first_step, self.last_step
        if digest_steps(self.session, first, last) != self.steps:
            yield f"steps {first} to {last} were changed"
        first, last = self.first_event, self.last_event
        if self.replaced_at is not None:
            if self.session.patient.erased_at is None:
                yield "it was replaced, though the patient was not erased"
        elif digest_events(self.session_id, first, last, original) != self.events:
            yield f"events {first} to {last} were changed"


def digest_steps(session: TrainingSession, first: int, last: int) -> str:
    """Return the digest of steps, with the plan that they were scored by."""
    digest = hashlib.sha256(_to_json(with_floats(session.plan)))
    rows = Step.everywhere.filter(session=session.pk, number__range=(first, last))
    if first <= last:
        for row in rows.order_by("number").values_list(*STEP_FIELDS):
            digest.update(_to_json([_plain(value) for value in row]))
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """Return a value of a step as every database gives it back."""
    kind = type(value)
    if kind is float:
        return value + 0.0  # no negative zero
    return with_floats(value) if kind in (dict, list) else value


def digest_events(session_id: int, first: int, last: int, original: Translate = same_key) -> str:
    """Return the digest of events, given by their places in the session."""
    digest = hashlib.sha256()
    if first <= last:
        rows = SessionEvent.everywhere.filter(session=session_id).order_by("pk")
        for by, *values in rows.values_list(*EVENT_FIELDS)[first - 1 : last]:
            who = None if by is None else original(User, by)
            digest.update(_to_json((who, with_floats(values))))
    return digest.hexdigest()


def seal_sessions(
    now: datetime,
    chosen: Q | None = None,
    pause_s: float = 0.0,
) -> int:
    """Seal what sessions have added, of the chosen ones. Return how many rows."""
    sealed = 0
    unsealed = TrainingSession.everywhere.filter(chosen or Q(), unsealed=True).order_by("pk")
    for key in list(unsealed.values_list("pk", flat=True)):
        session = TrainingSession.everywhere.filter(pk=key).first()
        while session is not None:
            try:
                count = _seal_next(session, now)
            except IntegrityError:  # another process seals this clinic's at this moment
                break
            sealed += count
            time.sleep(pause_s)
            if not count:
                break
    return sealed


def _sealed_ends(session_id: int) -> tuple[int, int]:
    """Return the last step and the last event that have a seal."""
    ends = SessionSeal.everywhere.filter(session=session_id).aggregate(
        step=Max("last_step"), event=Max("last_event")
    )
    return ends["step"] or 0, ends["event"] or 0


def _seal_next(session: TrainingSession, now: datetime) -> int:
    """Seal a session's next rows. Return how many; without any, note that it is sealed."""
    step, event = _sealed_ends(session.pk)
    last_step, last_event = _stored_ends(session.pk)
    until_step, until_event = min(last_step, step + BATCH_ROWS), min(last_event, event + BATCH_ROWS)
    count = until_step - step + until_event - event
    if count > 0:
        _add_seal(session, (step + 1, until_step), (event + 1, until_event), now)
        return count
    with transaction.atomic():  # who adds an event after the end waits for the row
        mine = TrainingSession.everywhere.select_for_update(no_key=True).filter(pk=session.pk)
        states = [state.value for state in OPEN_STATES]
        if mine.exclude(state__in=states).exists() and _stored_ends(session.pk) == (step, event):
            mine.update(unsealed=False)
    return 0


def _stored_ends(session_id: int) -> tuple[int, int]:
    """Return the number of the last step, and how many events there are."""
    steps = Step.everywhere.filter(session=session_id)
    number = steps.order_by("-number").values_list("number", flat=True).first()
    return number or 0, SessionEvent.everywhere.filter(session=session_id).count()


def _add_seal(
    session: TrainingSession, steps: tuple[int, int], events: tuple[int, int], now: datetime
) -> None:
    """Add a seal of these rows at the end of the clinic's chain."""
    digests = digest_steps(session, *steps), digest_events(session.pk, *events)
    before = last_seal(session.clinic_id)
    seal = SessionSeal(
        clinic_id=session.clinic_id,
        number=before.number + 1 if before else 1,
        moves=len(moves_of(session.clinic_id)),
        session=session,
        first_step=steps[0],
        last_step=steps[1],
        first_event=events[0],
        last_event=events[1],
        steps=digests[0],
        events=digests[1],
        previous=before.digest if before else "",
        sealed_at=now,
    )
    seal.digest = seal.compute_digest()
    with transaction.atomic():
        seal.save()


def replace_seals(patient: Patient, now: datetime) -> None:
    """Seal an erased patient's events as they are now; the earlier seals stay in the chain."""
    of_patient = SessionSeal.everywhere.filter(session__patient=patient, replaced_at=None)
    with_events = of_patient.filter(last_event__gte=F("first_event"))
    for old in list(with_events.order_by("number").select_related("session")):
        SessionSeal.everywhere.filter(pk=old.pk).update(replaced_at=now)
        _add_seal(old.session, (1, 0), (old.first_event, old.last_event), now)


def find_broken_of(clinic_id: int, since: datetime | None = None) -> Iterator[str]:
    """Yield what is wrong with a clinic's sessions; of rows only those sealed since a moment."""
    previous, number, moves = "", 0, moves_of(clinic_id)
    ends: dict[int, tuple[int, int]] = {}
    seals = SessionSeal.everywhere.filter(clinic=clinic_id).order_by("number")
    for seal in seals.select_related("session__patient").iterator(chunk_size=BATCH_ROWS):
        where, original = f"session {seal.session_id}", original_keys(moves, seal.moves)
        if (seal.previous, seal.number) != (previous, number + 1):
            yield f"{where}: the seal before its seal {seal.number} is another one"
        previous, number = seal.digest, seal.number
        if seal.compute_digest(original) != seal.digest:
            yield f"{where}: its seal {seal.number} was changed"
        step, event = ends.get(seal.session_id, (0, 0))
        ends[seal.session_id] = max(step, seal.last_step), max(event, seal.last_event)
        if since is None or seal.sealed_at >= since:
            yield from (f"{where}: {what}" for what in seal.find_changes(original))
    yield from _find_added(clinic_id, ends, since)


def _find_added(
    clinic_id: int, ends: dict[int, tuple[int, int]], since: datetime | None
) -> Iterator[str]:
    """Yield the sessions that count as sealed to their end and have more or fewer rows."""
    whole = TrainingSession.everywhere.filter(clinic=clinic_id, unsealed=False)
    if since is not None:
        whole = whole.filter(ended_at__gte=since)
    for key in whole.order_by("pk").values_list("pk", flat=True).iterator():
        if _stored_ends(key) != ends.get(key, (0, 0)):
            yield f"session {key}: rows were added or removed after its last seal"


def last_seal(clinic_id: int) -> SessionSeal | None:
    """Return the last seal of a clinic's sessions."""
    return SessionSeal.everywhere.filter(clinic=clinic_id).order_by("number").last()


def find_broken(since: datetime | None = None) -> Iterator[str]:
    """Yield what is wrong with the sessions of all clinics."""
    for clinic in Clinic.everywhere.order_by("pk"):
        yield from (f"clinic {clinic.pk}, {what}" for what in find_broken_of(clinic.pk, since))


def count_late(before: datetime) -> int:
    """Return how many sessions ended before a moment and have rows without a seal."""
    return TrainingSession.everywhere.filter(unsealed=True, ended_at__lt=before).count()

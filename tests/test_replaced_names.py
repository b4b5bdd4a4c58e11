"""Names that clearer ones have replaced do not come back."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

import pytest

# Module → names that it had, those of a class with a dot.
REPLACED = {
    "rehab.people.access": "person",
    "rehab.people.aliases": "say_alias",
    "rehab.people.audit.access_log": "note_request NO_PATIENTS",
    "rehab.people.audit.audit_log": (
        "note try_to_keep Appended AppendOnly VisibleEntries Recent recent compose note_safety "
        "shorten forget_before forget_patient AGAIN_AFTER REMEMBERED"
    ),
    "rehab.people.audit.history": (
        "doer acting nouns LEFT_OUT SECRET HIDDEN forget_values track HistoryEntry.noun "
        "HistoryEntry.row HistoryEntry.values"
    ),
    "rehab.people.audit.history_text": "Told Line SHOWN",
    "rehab.people.consent.models": "agreed FixedText PatientScope.narrow",
    "rehab.people.consent.services": (
        "holding offered may_be_watched may_be_cared_for give withdraw join_boards write_text "
        "FIRST_WORDS REMOTE_WORDS"
    ),
    "rehab.people.consent.tombstones": (
        "ErasedOriginal keep_away is_kept_away ImportTombstone.mark"
    ),
    "rehab.people.models": (
        "check_time_zone new_pseudonym Ending Erasing PersonErased UNAMBIGUOUS AccountManager "
        "VisibleAccounts Patient.hold Patient.keep Patient.original_id Patient.ended_because "
        "Patient.erased_because Clinic.keep_months Clinic.keep_log_months"
    ),
    "rehab.people.networks": "check_networks find_address is_within WHOLE_IPV6",
    "rehab.people.pages.consent": "write_words",
    "rehab.people.roles": "may_lend LENT",
    "rehab.people.scope": "visible CrossClinic ClinicRow Scope.of_clinic Scope.narrow",
    "rehab.people.server_status": "look_at_server",
    "rehab.people.sign_in.browser_sessions": "idle_limit ends_at NOTED_EVERY SEEN_AT note keep",
    "rehab.people.sign_in.factors": (
        "add remove forget_all recovery_codes_left take_code Authenticator.use "
        "Authenticator.material Authenticator.count RecoveryCode.digest"
    ),
    "rehab.people.sign_in.flow": "holds halfway PROVEN HALFWAY setting_up EntryMiddleware",
    "rehab.people.sign_in.lockout": "counted_name counted_by answer wait_of forgive CODES",
    "rehab.people.sign_in.passkeys": (
        "are_possible ask_to_make ask_to_sign keep take NotProven STATE"
    ),
    "rehab.people.sign_in.recovery_codes": "RECOVERY_CODES new_recovery_code digest_of",
    "rehab.people.sign_in.tokens": "TokenRow find_holder find_caller SEEN_EVERY",
    "rehab.people.sign_in.totp": "new_secret address code_of step_of STEP_S DRIFT",
    "rehab.people.web.admin_base": "rights owns NarrowedList RowFormSet RowAdmin",
    "rehab.people.web.admin_preview": "find_faults PreviewAdmin.draw",
    "rehab.people.web.api_base": (
        "left_out cut answers Given Whole Words Moment Token Browser PerPerson say_errors "
        "to_whole no_bare_number to_reach sees_names"
    ),
    "rehab.people.web.language": "chosen_language speak_to FOR_PROGRAMS",
    "rehab.people.web.refusals": "in_words",
    "rehab.sessions.models": "TrainingSession.original_id TrainingSession.original",
    "rehab.sessions.events": "Told report_event",
    "rehab.sessions.live.audit_queue": "Note Notes AuditQueue.settled",
    "rehab.sessions.live.auth": (
        "find_actor find_device_by token_of headers_of cookies_of session_key_of is_own_page "
        "find_unwelcome keep_signed_in address_of open_session_of"
    ),
    "rehab.sessions.live.backlog": "read_steps is_stored PAGE MOVES",
    "rehab.sessions.live.consumers.base": (
        "Closing NowhereConsumer Socket.opened Socket.heard Socket.left Socket.say Socket.end "
        "Socket.shut Socket.send_off Socket.see_through Socket.refuse_silence"
    ),
    "rehab.sessions.live.consumers.device": (
        "DeviceSocket.asked DeviceSocket.attached DeviceSocket.greet DeviceSocket.send_away "
        "DeviceSocket.said_hello DeviceSocket.session_opened"
    ),
    "rehab.sessions.live.consumers.screens": (
        "ScreenConsumer.is_welcome ScreenConsumer.pauses_as MonitorConsumer.changes"
    ),
    "rehab.sessions.live.hub": (
        "Channel Viewer Unseen EventFeed.since Subscriber.beat Subscriber.seen "
        "Subscriber.send_past MAX_UNSEEN MAX_UNSEEN_PAST UNSEEN_S ABSENT_S"
    ),
    "rehab.sessions.live.lateness": "Lateness.slacken",
    "rehab.sessions.live.loading": "Loaded RECENT",
    "rehab.sessions.live.messages": "NAMED ROBOT_STATES GESTURE_PHASES",
    "rehab.sessions.live.owners": "my_name find_left_running PROCESSES",
    "rehab.sessions.live.runtime": "Runtime.admitted Runtime.at_station_of Stop",
    "rehab.sessions.live.session": (
        "LiveSession.take LiveSession.join LiveSession.admission LiveSession.settled "
        "LiveSession.heard_robot Stop LOGGED UNTOLD RECENT source_phase"
    ),
    "rehab.sessions.live.aggregate": (
        "SessionActor SessionAggregate.take SessionAggregate.note MARKED"
    ),
    "rehab.sessions.live.supervisor": "Children LONGEST_PAUSE_S FIRST_PAUSE_S STEADY_S",
    "rehab.sessions.live.writer": "Refolded",
    "rehab.sessions.payloads": "MARKED_CHANGES",
    "rehab.training.changes": "TRANSITIONS CHANGE_LABELS REQUESTABLE next_state Told",
    "rehab.stations.builtin": "builtin_token",
    "rehab.stations.models": "LeaveTries PinAttempts.who PinAttempts.wrong PinAttempts.open_at",
    "rehab.stations.pairing": (
        "begin find approve collect PairingFlooded MOST_OPEN MOST_SHOWN MOST_BEGUN TRIES"
    ),
    "rehab.stations.pins": "wait_after FREE_TRIES FIRST_WAIT LONGEST_WAIT SHORTEST LONGEST",
    "rehab.stations.presence": "say_seen say_state NEVER_AFTER",
    "rehab.stations.tablets": "remember",
}
GONE = (
    *(
        "rehab.people.entry",
        "rehab.people.codes",
        "rehab.people.sightings",
        "rehab.people.audit_log",
    ),
    *(
        "rehab.people.api_base",
        "rehab.people.lockout",
        "rehab.people.history",
        "rehab.people.views",
    ),
    *(
        "rehab.sessions.live.actor",
        "rehab.sessions.live.admission",
        "rehab.sessions.live.children",
        "rehab.sessions.live.notes",
        "rehab.sessions.live.past",
        "rehab.sessions.facts",
    ),
)


@pytest.mark.parametrize("module", REPLACED)
def test_replaced_names_do_not_resolve(module):
    loaded = import_module(module)
    for name in REPLACED[module].split():
        holder, _, attribute = name.rpartition(".")
        where = getattr(loaded, holder) if holder else loaded
        assert not hasattr(where, attribute), f"{module}.{name}"


def test_replaced_modules_are_gone():
    for module in GONE:
        assert find_spec(module) is None, module

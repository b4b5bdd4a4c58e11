"""Addresses of the pages of sessions."""

from django.urls import path

from rehab.sessions.pages import (
    after_session,
    alarms,
    history,
    incident,
    insight,
    monitor,
    paper,
    recording,
    replay,
    screen_size,
    session,
    setup,
    tablet,
    walk,
    words,
)
from rehab.sessions.pages.server import health, metrics

urlpatterns = [
    path("healthz", health.healthz, name="healthz"),
    path("readyz", health.readyz, name="readyz"),
    path("metrics", metrics.metrics, name="metrics"),
    path("patients/<int:patient_id>/new/", setup.set_up, name="setup"),
    path("patients/<int:patient_id>/sessions/", history.list_sessions, name="history"),
    path("patients/<int:patient_id>/home/", paper.show_take_home, name="take-home"),
    path("insight/", insight.show_insight, name="insight"),
    path("recordings/check/", recording.check_recording, name="check-recording"),
    path("recordings/part/", recording.add_recording_part, name="add-recording-part"),
    path("screen-size/", screen_size.set_screen_size, name="screen-size"),
    path("tablet/", tablet.show_tablet, name="tablet"),
    path("tablet/app.webmanifest", tablet.web_app_manifest, name="tablet-app"),
    path("tablet/state/", tablet.tablet_state, name="tablet-state"),
    path("sessions/<int:session_id>/", walk.show_walk, name="walk"),
    path("sessions/<int:session_id>/monitor/", monitor.show_monitor, name="monitor"),
    path("sessions/<int:session_id>/words/", words.edit_words, name="words"),
    path("sessions/<int:session_id>/note/", monitor.write_note, name="write-note"),
    path("sessions/<int:session_id>/report/", paper.show_report, name="report"),
    path("sessions/<int:session_id>/details/", session.show_session, name="session"),
    path("sessions/<int:session_id>/questions/", after_session.ask_questions, name="questions"),
    path(
        "sessions/<int:session_id>/questions/add/",
        after_session.add_questionnaire,
        name="add-questionnaire",
    ),
    path("sessions/<int:session_id>/replay/", replay.show_replay, name="replay"),
    path("alarms/", alarms.show_alarms, name="alarms"),
    path(
        "sessions/<int:session_id>/alarms/seen/",
        alarms.acknowledge_alarms,
        name="acknowledge-alarms",
    ),
    path("incidents/", alarms.list_incidents, name="incidents"),
    path("incidents/<int:incident_id>/", incident.show_incident, name="incident"),
    path("incidents/<int:incident_id>/file/", incident.download_incident, name="incident-file"),
    path("sessions/<int:session_id>/correct/", session.correct, name="correct"),
]

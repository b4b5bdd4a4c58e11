"""URLs of studies and their participants."""

from django.urls import path

from rehab.studies.pages import (
    confirming,
    participants,
    planning,
    power,
    record,
    results,
    sponsor_overview,
)

urlpatterns = [
    path("studies/", planning.list_studies, name="studies"),
    path("studies/new/", planning.plan_study, name="new-study"),
    path("studies/size/", planning.show_size, name="study-size"),
    path("studies/<int:study_id>/", planning.show_study, name="study"),
    path("studies/<int:study_id>/plan/", planning.plan_study, name="plan-study"),
    path(
        "studies/<int:study_id>/register/",
        confirming.confirm_step,
        {"step": "register"},
        name="register-study",
    ),
    path(
        "studies/<int:study_id>/start/",
        confirming.confirm_step,
        {"step": "start"},
        name="start-study",
    ),
    path("studies/<int:study_id>/close/", planning.close_study, name="close-study"),
    path("studies/<int:study_id>/marks/", planning.change_marks, name="study-marks"),
    path(
        "studies/<int:study_id>/protocol.json",
        planning.download_protocol,
        {"kind": "json"},
        name="study-protocol",
    ),
    path(
        "studies/<int:study_id>/protocol.pdf",
        planning.download_protocol,
        {"kind": "pdf"},
        name="study-protocol-pdf",
    ),
    path("studies/<int:study_id>/results/", results.show_results, name="study-results"),
    path(
        "studies/<int:study_id>/results/download/",
        results.download_results,
        name="study-results-file",
    ),
    path("studies/<int:study_id>/figures/", sponsor_overview.show_figures, name="study-figures"),
    path("studies/<int:study_id>/record/", record.edit_facts, name="study-facts"),
    path(
        "studies/<int:study_id>/checklists.csv",
        record.download_checklists,
        name="study-checklists",
    ),
    path("studies/<int:study_id>/harms/", record.show_harms, name="study-harms"),
    path("studies/<int:study_id>/power/", power.show_power, name="study-power"),
    path("power-runs/<int:run_id>/", power.go_on, name="power-run"),
    path("studies/<int:study_id>/enroll/", participants.enroll_patient, name="enroll"),
    path("participants/<int:enrollment_id>/", participants.show_participant, name="participant"),
    path("participants/<int:enrollment_id>/start/", participants.start_visit, name="start-visit"),
    path("participants/<int:enrollment_id>/leave/", participants.leave_study, name="leave-study"),
    path("participants/<int:enrollment_id>/guess/", participants.note_guess, name="note-guess"),
    path("participants/<int:enrollment_id>/agree/", participants.agree_again, name="agree-again"),
    path("participants/<int:enrollment_id>/reveal/", participants.reveal, name="reveal"),
]

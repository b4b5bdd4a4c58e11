"""URLs of the start list and of a patient's pages."""

from django.urls import path

from rehab.patients.pages import (
    caseload,
    family,
    first_steps,
    phone_trial,
    records,
    session_end,
    start,
    take_home,
    visits,
)

urlpatterns = [
    path("start/", start.choose_patient, name="start"),
    path("caseload/", caseload.show_caseload, name="caseload"),
    path("first-steps/", first_steps.first_steps, name="first-steps"),
    path("first-steps/state/", first_steps.first_steps_state, name="first-steps-state"),
    path("patients/new/", start.add_patient, name="new-patient"),
    path("first-steps/phone/", phone_trial.try_phone, name="try-phone"),
    path("first-steps/phone/open/", phone_trial.open_trial_phone, name="open-trial-phone"),
    path("first-steps/phone/state/", phone_trial.trial_state, name="trial-state"),
    path("patients/demo/", start.add_demo, name="demo"),
    path("patients/<int:patient_id>/", start.show_patient, name="patient"),
    path("patients/<int:patient_id>/details/", start.edit_patient, name="edit-patient"),
    path("patients/<int:patient_id>/screen/", start.set_screen, name="screen"),
    path("patients/<int:patient_id>/screen/check/", start.check_screen, name="check-screen"),
    path("sessions/<int:session_id>/ending/", session_end.show_ending, name="ending"),
    path("patients/<int:patient_id>/home/", take_home.show_take_home, name="take-home"),
    path("patients/<int:patient_id>/visits/", visits.change_visits, name="visits"),
    path("patients/<int:patient_id>/records/", records.show_records, name="records"),
    path("patients/<int:patient_id>/family/", family.show_links, name="family-links"),
    path("family-links/<int:link_id>/end/", family.end_family_link, name="end-family-link"),
    path("family/<str:token>/", family.show_family, name="family"),
    path("patients/<int:patient_id>/end/", records.end_patient_program, name="end-program"),
    path("patients/<int:patient_id>/reopen/", records.reopen_patient_program, name="reopen"),
    path("patients/<int:patient_id>/erase/", records.erase_patient, name="erase"),
]

"""Addresses of consent and data."""

from django.urls import path

from rehab.exports import views

urlpatterns = [
    path("patients/<int:patient_id>/records/", views.show_records, name="records"),
    path("patients/<int:patient_id>/records/data.zip", views.give_patient, name="patient-data"),
    path("patients/<int:patient_id>/end/", views.end, name="end-program"),
    path("patients/<int:patient_id>/reopen/", views.reopen, name="reopen"),
    path("patients/<int:patient_id>/erase/", views.erase_patient, name="erase"),
    path("export/", views.show_export, name="export"),
    path("export/sessions.zip", views.give_sessions, name="export-sessions"),
]

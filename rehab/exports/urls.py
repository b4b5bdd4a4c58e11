"""Addresses of the data that is given out."""

from django.urls import path

from rehab.exports import views

urlpatterns = [
    path("patients/<int:patient_id>/records/data.zip", views.give_patient, name="patient-data"),
    path("export/", views.show_export, name="export"),
    path("export/sessions.zip", views.give_sessions, name="export-sessions"),
]

"""URLs of exports."""

from django.urls import path

from rehab.exports import views

urlpatterns = [
    path("patients/<int:patient_id>/records/data.zip", views.download_patient, name="patient-data"),
    path("insight/sessions.csv", views.download_insight, name="insight-file"),
    path("export/", views.show_export, name="export"),
    path("export/sessions.zip", views.download_sessions, name="export-sessions"),
]

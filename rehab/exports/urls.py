"""URLs of exports."""

from django.urls import path

from rehab.exports import clinic_pages, views

urlpatterns = [
    path("patients/<int:patient_id>/records/data.zip", views.download_patient, name="patient-data"),
    path("insight/sessions.csv", views.download_insight, name="insight-file"),
    path("export/", views.show_export, name="export"),
    path("export/research/", views.prepare_research, name="prepare-research"),
    path("export/research/advance/", views.advance_research, name="advance-research"),
    path("export/research.zip", views.download_research, name="download-research"),
    path("export/sessions.zip", views.download_sessions, name="export-sessions"),
    path("clinics/<int:clinic_id>/move/", clinic_pages.move_clinic, name="move-clinic"),
    path("clinics/<int:clinic_id>/clinic.age", clinic_pages.download_clinic, name="clinic-file"),
    path(
        "clinics/<int:clinic_id>/gone.json", clinic_pages.download_certificate, name="clinic-gone"
    ),
]

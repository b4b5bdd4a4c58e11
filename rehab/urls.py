"""The URLs of all rooms."""

from django.urls import include, path

from rehab import api
from rehab.management.report_page import report_problem

urlpatterns = [
    path("api/v1/", include((api.urls(), "ninja"), namespace="api")),
    path("problem-report/", report_problem, name="problem-report"),
    path("", include("rehab.people.urls")),
    path("", include("rehab.stations.urls")),
    path("", include("rehab.sessions.urls")),
    path("", include("rehab.patients.urls")),
    path("", include("rehab.boards.urls")),
    path("", include("rehab.studies.urls")),
    path("", include("rehab.exports.urls")),
]

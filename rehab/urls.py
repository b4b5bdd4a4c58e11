"""Gathers the rooms' addresses, nothing else."""

from django.urls import include, path

urlpatterns = [
    path("", include("rehab.people.urls")),
    path("", include("rehab.stations.urls")),
    path("", include("rehab.sessions.urls")),
    path("", include("rehab.boards.urls")),
]

"""Addresses of scores."""

from django.urls import path

from rehab.boards import views

urlpatterns = [
    path("sessions/<int:session_id>/scores/", views.show_scores, name="scores"),
]

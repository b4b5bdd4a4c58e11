"""Addresses of the front page."""

from django.urls import path

from rehab.people import views

urlpatterns = [
    path("", views.home, name="home"),
    path("healthz", views.healthz, name="healthz"),
]

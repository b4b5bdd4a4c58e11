"""URLs of stations."""

from django.urls import path

from rehab.stations import views

urlpatterns = [
    path("tablets/pair/", views.pair, name="pair"),
    path("tablets/leave/", views.leave, name="leave"),
]

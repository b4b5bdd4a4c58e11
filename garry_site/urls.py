"""The URLs of the site: the admin, and GARRY's own pages."""

from django.contrib import admin
from django.urls import include, path

urlpatterns = [
    path("admin/", admin.site.urls),
    path("", include("rehab.urls")),
]

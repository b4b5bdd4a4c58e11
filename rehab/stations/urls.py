"""URLs of stations."""

from django.urls import path

from rehab.stations.pages import https, pairing, phones, stations

urlpatterns = [
    path("tablets/pair/", pairing.pair, name="pair"),
    path("tablets/leave/", pairing.leave, name="leave"),
    path("phones/pair/", phones.pair_phone, name="pair-phone"),
    path("https/", https.set_up_https, name="https"),
    path("certificate/", https.show_certificate, name="certificate"),
    path("certificate/garry.crt", https.download_certificate, name="certificate-file"),
    path("sensor/", phones.show_sensor, name="sensor"),
    path("sensor/trial.json", phones.trial_walk, name="trial-walk"),
    path("stations/new/", stations.edit_station, name="new-station"),
    path("stations/<int:station_id>/", stations.edit_station, name="edit-station"),
    path("stations/<int:station_id>/devices/", stations.add_device, name="new-device"),
    path("devices/<int:device_id>/", stations.change_device, name="change-device"),
]

"""URLs of scores and boards."""

from django.urls import path

from rehab.boards import views

urlpatterns = [
    path("sessions/<int:session_id>/scores/", views.show_scores, name="scores"),
    path("sessions/<int:session_id>/scores/leave/", views.leave_boards, name="leave-boards"),
    path("tablet/board/", views.show_waiting_board, name="waiting-board"),
]

"""A board that would rank by feedback type, or list a person twice, cannot be built."""

from datetime import date
from typing import Any
from urllib.parse import urlencode

import pytest
from django.core.exceptions import ValidationError
from django.urls import reverse, reverse_lazy

from rehab.boards import cache
from rehab.boards.cache_invalidation import BoardChange
from rehab.boards.models import Leaderboard
from rehab.boards.ranking import results
from rehab.boards.validation import FIRST_DAY, LAST_DAY
from rehab.people.aliases import MANNERS, draw_alias, split_list
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from tests.support.world import build_world, client_of, fill_board, signed_in

pytestmark = pytest.mark.django_db


def board(**fields) -> Leaderboard:
    clinic = Clinic.everywhere.get_or_create(name="Elm")[0]
    return Leaderboard(clinic=clinic, name="Steps at the goal", **fields)


def test_the_defaults_are_safe():
    made = board()
    made.full_clean()
    defaults = {
        "among": "self",
        "types": "same",
        "metric": "hit_rate",
        "aggregation": "each",
        "min_valid_strides": 100,
        "include_simulated": False,
        "period": "days_30",
        "ties": "standard",
        "display": "neighbors",
        "show_ranks": True,
        "names": "pseudonym",
        "min_participants": 5,
        "occasion": "after_session",
        "frozen_on": None,
        "higher_is_better": True,
    }
    assert {name: getattr(made, name) for name in defaults} == defaults


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"metric": "score", "types": "all"}, "never above 0"),
        (
            {"metric": "score", "types": "chosen", "valences": ["positive", "negative"]},
            "never above",
        ),
        ({"metric": "score", "types": "chosen", "valences": ["explicit"]}, "has no points"),
        ({"tie_breaker": "score", "types": "all"}, "never above 0"),
        (
            {
                "tie_breaker": "points_per_100_steps",
                "types": "chosen",
                "valences": ["positive", "negative"],
            },
            "never above",
        ),
        (
            {"tie_breaker": "score", "types": "chosen", "valences": ["explicit"]},
            "has no points",
        ),
        (
            {"period": "dates", "period_from": date(2026, 1, 1), "period_to": date.max},
            "ends on the last one",
        ),
        (
            {"period": "dates", "period_from": date.min, "period_to": date(2026, 1, 1)},
            "from 1 Jan 1970 to 31 Dec 2199",
        ),
        ({"frozen_on": date.min}, "Give a day from"),
        ({"types": "chosen"}, "at least one type"),
        ({"types": "chosen", "valences": ["kind"]}, "positive, negative, binary, explicit"),
        ({"valences": "positive"}, "Give a list"),
        ({"among": "clinic"}, "one row for each"),
        ({"min_participants": 3}, "Give 5 or more"),
        ({"period": "dates"}, "Give both dates"),
        ({"aggregation": "best"}, "Choose “Each session”"),
        ({"metric": "attended"}, "Compare with other patients"),
        ({"display": "total"}, "reached together"),
        ({"among": "clinic", "aggregation": "sum"}, "cannot be added up"),
        ({"among": "clinic", "aggregation": "best", "metric": "target_met"}, "Choose the sum"),
        ({"among": "clinic", "aggregation": "best", "display": "total"}, "Choose the sum"),
        ({"occasion": "waiting"}, "belongs to nobody yet"),
        (
            {"occasion": "waiting", "among": "clinic", "aggregation": "best"},
            "belongs to nobody yet",
        ),
        (
            {"occasion": "waiting", "among": "clinic", "aggregation": "best", "display": "top"},
            "no session at hand",
        ),
        ({"among": "across", "aggregation": "best"}, "the host's"),
        ({"among": "across", "aggregation": "best", "names": "code"}, "animal names only"),
        ({"top_n": 0}, "Give 1 to 50"),
        ({"tie_breaker": "luck"}, "not a valid choice"),
    ],
)
def test_a_board_that_would_mislead_is_refused(fields, message):
    with pytest.raises(ValidationError, match=message):
        board(**fields).full_clean()


def test_points_of_one_type_may_be_ranked():
    board(metric="score", types="chosen", valences=["binary"]).full_clean()
    board(metric="score", types="same").full_clean()


# --- in the admin ---------------------------------------------------------------------------------


def filled(**fields) -> dict[str, Any]:
    """What a form sends that was only given a name."""
    board = Leaderboard(name="Board")
    names = [field.name for field in Leaderboard._meta.concrete_fields if field.editable]
    sent = {name: getattr(board, name) for name in names if name not in {"id", "clinic"}}
    return {name: value for name, value in (sent | fields).items() if value not in (None, False)}


PREVIEW = reverse_lazy("admin:rehab_leaderboard_preview")


def test_one_name_is_enough_to_save_a_board(world):
    client = client_of(world)
    answer = client.post(reverse("admin:rehab_leaderboard_add"), filled())
    assert answer.status_code == 302, answer.context["errors"]
    board = Leaderboard.everywhere.get(name="Board")
    assert (board.clinic, board.among, board.active) == (world.clinic, "self", True)


def test_a_preview_shows_the_clinics_own_rows_and_stores_nothing(world):
    fill_board(world)
    client = client_of(world)
    counts = [model.everywhere.count() for model in (Leaderboard, BoardChange)]
    wanted = filled(
        among="clinic", aggregation="best", names="code", min_valid_strides=1, period="all", name=""
    )
    page = client.get(PREVIEW, wanted).content.decode()
    assert world.patient.code in page
    assert page.count('class="rank"') == 3
    assert 'data-facts="5 patients on it now."' in page
    alone = client.get(PREVIEW, wanted | {"min_participants": 6}).content.decode()
    assert "Fewer than 6 people so far." in alone
    assert [model.everywhere.count() for model in (Leaderboard, BoardChange)] == counts
    assert client.post(PREVIEW).status_code == 405


def test_what_is_seen_in_the_preview_is_what_the_tablet_shows(world):
    fill_board(world)
    board = Leaderboard.everywhere.get(among="clinic")
    client = client_of(world)
    fields = filled(**{name: getattr(board, name) for name in filled()})
    preview = client.get(PREVIEW, fields | {"row": board.pk, "seen_as": world.patient.pk})
    shown = client.get(reverse("scores", kwargs={"session_id": world.session.pk}))
    rows = [
        answer.content.decode().split("<ol>")[1].split("</ol>")[0] for answer in (preview, shown)
    ]
    assert rows[0].split() == rows[1].split()


@pytest.mark.parametrize("zone", ["Pacific/Kiritimati", "America/Los_Angeles"])
def test_the_first_and_the_last_day_can_be_chosen_and_none_beyond(world, zone):
    Clinic.everywhere.filter(pk=world.clinic.pk).update(time_zone=zone)
    client = client_of(world)
    wanted = filled(among="clinic", aggregation="best", period="dates")
    for first, last, status in (
        (FIRST_DAY, LAST_DAY, 302),
        (date(2026, 1, 1), date.max, 200),
        (date.min, date(2026, 1, 1), 200),
    ):
        days = {"period_from": str(first), "period_to": str(last)}
        page = client.get(PREVIEW, wanted | days)
        assert page.status_code == 200
        assert ("Give a day from" in page.content.decode()) == (status == 200)
        assert client.post(reverse("admin:rehab_leaderboard_add"), wanted | days).status_code == (
            status
        )


def test_a_preview_is_computed_once_for_each_definition_and_group(world, monkeypatch):
    fill_board(world)
    board = Leaderboard.everywhere.get(among="clinic")
    Patient.everywhere.create(clinic=world.clinic, code="N", nickname="N", boards="clinic")
    people = list(Patient.everywhere.filter(clinic=world.clinic, boards="clinic"))
    board.among = "group"
    board.save()
    board.group.set(people)
    client = client_of(world)
    fields = filled(**{name: getattr(board, name) for name in filled()}) | {"row": board.pk}
    group = [patient.pk for patient in people]
    read: list[bool] = []

    def read_results(*given: Any) -> Any:
        read.append(True)
        return results.read_results(*given)

    monkeypatch.setattr(cache, "read_results", read_results)
    shown: tuple[dict[str, Any], ...] = ({}, {"top_n": 3}, {"name": "Renamed", "show_ranks": ""})
    for other in shown:
        page = client.get(PREVIEW, fields | {"group": group} | other).content.decode()
        assert "5 patients on it now." in page
    assert len(read) == 1
    made: tuple[dict[str, Any], ...] = (
        {"metric": "steps"},
        {"group": group[1:]},
        {"frozen_on": "2026-01-01"},
    )
    for number, other in enumerate(made, start=2):
        client.get(PREVIEW, fields | {"group": group} | other)
        assert len(read) == number
    client.get(PREVIEW, fields | {"among": "self", "aggregation": "each"})
    assert len(read) == 4


def test_a_preview_says_what_cannot_be(world):
    client = client_of(world)
    page = client.get(PREVIEW, filled(metric="score", types="all")).content.decode()
    assert "<b>Measure</b> Points of different feedback types cannot be compared" in page


def test_a_group_has_patients_of_the_own_clinic_and_enough_of_them(world):
    other = build_world("birch")
    client = client_of(world)
    wanted = filled(among="group", aggregation="best")
    few = client.get(PREVIEW, wanted | {"group": [world.patient.pk]}).content.decode()
    assert "Choose at least 5 patients." in few
    foreign = client.get(PREVIEW, wanted | {"group": [other.patient.pk]}).content.decode()
    assert "not one of the available choices" in foreign


@pytest.mark.long
def test_a_group_of_a_thousand_is_saved_and_one_of_more_is_told_what_to_do(world):
    Patient.everywhere.bulk_create(
        Patient(clinic=world.clinic, code=f"g{n}", nickname="G", pseudonym=f"G-{n}")
        for n in range(1001)
    )
    client = client_of(world)
    many = list(Patient.everywhere.filter(nickname="G").values_list("pk", flat=True))
    wanted = filled(among="group", aggregation="best") | {"group": many}
    for answer in (
        client.get(PREVIEW, wanted),
        client.post(reverse("admin:rehab_leaderboard_add"), wanted),
    ):
        assert answer.status_code == 200
        assert "Choose at most 1000 patients, or all of the clinic." in answer.content.decode()
    wanted["group"] = many[:1000]
    # The server refuses addresses beyond 16 kB; keys have up to seven digits.
    assert len(urlencode({**wanted, "group": [9_999_999] * 1000}, doseq=True)) < 15_000
    assert client.post(reverse("admin:rehab_leaderboard_add"), wanted).status_code == 302
    assert Leaderboard.everywhere.get(name="Board").group.count() == 1000


@pytest.mark.parametrize(
    ("role", "status"), [(Role.LEAD, 200), (Role.PT, 200), (Role.RESEARCHER, 403)]
)
def test_who_may_not_build_a_board_sees_no_preview(world, role, status):
    assert client_of(world, role).get(PREVIEW, filled()).status_code == status


def test_only_a_host_builds_boards_across_clinics_and_sees_no_patient_in_it(world):
    host = signed_in(User.everywhere.create_user("host", role=Role.HOST))
    wanted = filled(name="Across", among="across", aggregation="best")
    pt = client_of(world)
    assert "not one of the available choices" in pt.get(PREVIEW, wanted).content.decode()
    preview = host.get(PREVIEW, wanted).content.decode()
    assert "a host does not see" in preview
    answer = host.post(reverse("admin:rehab_leaderboard_add"), wanted)
    assert answer.status_code == 302, answer.context["errors"]
    board = Leaderboard.everywhere.get(name="Across")
    assert board.clinic is None
    change = reverse("admin:rehab_leaderboard_change", kwargs={"object_id": board.pk})
    assert pt.get(change).status_code == 302  # the clinic takes no part in it
    world.clinic.boards_across = True
    world.clinic.save()
    assert pt.get(change).status_code == 200  # to be read
    assert pt.post(change, wanted).status_code == 403


def test_animal_names_are_drawn_on_agreeing_and_again_on_demand(world):
    patient = Patient.everywhere.create(clinic=world.clinic, code="N", nickname="N")
    assert patient.alias is None
    patient.boards = "total"
    patient.save(update_fields=["boards"])
    patient.refresh_from_db()
    first = patient.alias
    assert str(first).split()[0] in split_list(MANNERS)
    client = client_of(world)
    sent = {"action": "draw_aliases", "_selected_action": [patient.pk]}
    assert client.post(reverse("admin:rehab_patient_changelist"), sent).status_code == 302
    patient.refresh_from_db()
    assert patient.alias not in {None, first}


def test_names_never_run_out():
    taken: set[str] = set()
    for _ in range(3000):
        name = draw_alias(taken.__contains__)
        assert name not in taken
        taken.add(name)


def test_two_boards_of_opposite_order_cannot_show_everybody(world):
    """Each shows the first half of its own order: together these are all patients."""
    board = Leaderboard.everywhere.get(among="clinic")
    other = Leaderboard(clinic=world.clinic, name="Other", among="group", metric=board.metric)
    other.aggregation, other.display = board.aggregation, board.display
    other.clean()
    other.higher_is_better = not board.higher_is_better
    with pytest.raises(ValidationError, match="the other way round"):
        other.clean()
    changes: tuple[dict[str, Any], ...] = (
        {"active": False},
        {"metric": "active_minutes"},
        {"among": "self", "aggregation": "each"},
    )
    for change in changes:
        fine = Leaderboard(clinic=world.clinic, name="Other", among="group", metric=board.metric)
        fine.aggregation, fine.display = board.aggregation, board.display
        fine.higher_is_better = not board.higher_is_better
        for name, value in change.items():
            setattr(fine, name, value)
        fine.clean()

"""One page lets people in; who guesses waits; who leaves is signed out."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.sessions.models import Session
from django.db.models import F
from django.test import Client, RequestFactory
from django.utils import timezone

from rehab.people.models import Clinic, User
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import attempt_counter
from rehab.people.sign_in.attempt_counter import SignInAttempts
from rehab.people.sign_in.sign_in_expiry import LAST_ACTIVITY_AT, SIGNED_IN_AT
from tests.support.accounts import PASSWORD, add_account, enter, is_in

pytestmark = pytest.mark.django_db


@pytest.fixture
def pt() -> User:
    return add_account()


def test_a_stranger_comes_back_to_the_page_that_was_asked_for(client, pt):
    asked = client.get("/patients/new/?from=list")
    assert asked.headers["Location"] == "/sign-in/?next=/patients/new/%3Ffrom%3Dlist"
    answer = enter(client, next_url="/patients/new/?from=list")
    assert answer.headers["Location"] == "/patients/new/?from=list"
    assert is_in(client)


def test_nobody_is_led_to_a_foreign_page(client, pt):
    answer = enter(client, next_url="https://elsewhere.example/")
    assert answer.headers["Location"] == "/start/"


def test_the_admin_has_no_door_of_its_own(client, pt):
    page = client.get("/admin/rehab/patient/", follow=True)
    assert page.redirect_chain[-1][0] == "/sign-in/?next=/admin/rehab/patient/"
    assert client.get("/admin/login/").headers["Location"] == "/sign-in/?next=/admin/"
    enter(client)
    assert client.get("/admin/password_change/").headers["Location"] == "/account/password/"
    assert client.post("/admin/logout/").headers["Location"] == "/sign-in/"
    assert not is_in(client)


@pytest.mark.parametrize("role", [Role.RESEARCHER, Role.HOST])
def test_who_may_not_open_the_start_page_begins_in_the_admin(client, pt, role):
    clinic = None if role == Role.HOST else pt.clinic
    add_account("other", role, clinic)
    assert enter(client, username="other").headers["Location"] == "/admin/"


def test_signing_out_takes_a_post(client, pt):
    enter(client)
    assert client.get("/sign-out/").status_code == 405
    assert is_in(client)
    assert client.post("/sign-out/").status_code == 302
    assert not is_in(client)


def test_a_wrong_password_is_told_without_telling_who_exists(client, pt):
    known = enter(client, "wrong").content.decode()
    unknown = enter(client, "wrong", username="nobody").content.decode()
    assert "Name and password do not match" in known
    assert "Name and password do not match" in unknown


def test_the_page_can_be_read_by_a_screen_reader(client):
    page = client.get("/sign-in/").content.decode()
    assert page.count("<h1") == page.count("<main") == 1
    for name in ("id_username", "id_password"):
        assert f'for="{name}"' in page
        assert f'id="{name}"' in page


# --- guessing -----------------------------------------------------------------------------------


def pass_time(**passed: float) -> None:
    """Move all that is counted into the past."""
    for name in ("counted_at", "locked_until"):
        SignInAttempts.everywhere.update(**{name: F(name) - timedelta(**passed)})


def guess(client: Client, times: int, **options: str):
    for _ in range(times):
        answer = enter(client, "wrong", **options)
    return answer


def test_five_wrong_passwords_close_the_door_for_a_quarter_of_an_hour(client, pt):
    guess(client, 4)
    shut = guess(client, 1)
    assert shut.status_code == 429
    assert 890 < int(shut.headers["Retry-After"]) <= 900
    assert "Try again in 15 minutes, or ask" in shut.content.decode()
    refused = enter(client)
    assert refused.status_code == 429
    assert not is_in(client)
    # Time passes: the tries move into the past. To try meanwhile does not put the end off.
    pass_time(minutes=14, seconds=30)
    assert "Try again in a minute" in enter(client).content.decode()
    pass_time(seconds=31)
    enter(client)
    assert is_in(client)


def test_nobody_shuts_a_therapist_out_from_elsewhere(pt):
    guess(Client(REMOTE_ADDR="203.0.113.9"), 5)
    here = Client(REMOTE_ADDR="198.51.100.1")
    enter(here)
    assert is_in(here)


@pytest.mark.wide
def test_whoever_tries_many_names_is_shut_out_at_that_address(pt):
    thief = Client(REMOTE_ADDR="203.0.113.9")
    for number in range(30):
        answer = enter(thief, "wrong", username=f"person{number}")
    assert answer.status_code == 429
    assert enter(thief).status_code == 429
    elsewhere = Client(REMOTE_ADDR="198.51.100.1")
    enter(elsewhere)
    assert is_in(elsewhere)


@pytest.mark.wide
def test_guesses_from_many_addresses_count_together_but_not_where_the_owner_comes_from(pt):
    enter(Client(REMOTE_ADDR="198.51.100.1"))  # the owner, a while ago
    for number in range(50):
        answer = guess(Client(REMOTE_ADDR=f"203.0.113.{number}"), 1)
    assert answer.status_code == 429
    assert enter(Client(REMOTE_ADDR="203.0.113.200")).status_code == 429
    owner = Client(REMOTE_ADDR="198.51.100.1")
    enter(owner)
    assert is_in(owner)


@pytest.mark.wide
def test_right_passwords_shut_nobody_out(pt):
    for _ in range(35):
        client = Client()
        enter(client)
        assert is_in(client)


def test_what_was_counted_is_deleted_when_it_no_longer_counts(client, pt):
    for number in range(3):
        guess(client, 1, username=f"person{number}")
    assert SignInAttempts.everywhere.count() == 7  # of the address, and two of each name
    pass_time(minutes=31)
    guess(client, 1)
    assert SignInAttempts.everywhere.count() == 3


def test_coming_in_forgets_wrong_tries(client, pt):
    for _ in range(3):
        guess(client, 4)
        enter(client)
        assert is_in(client)


def test_a_lead_unlocks_accounts_of_the_own_clinic_only(client, pt):
    other = Clinic.everywhere.create(name="Oak")
    for name, clinic in (("lead", pt.clinic), ("oak", other)):
        add_account(name, Role.LEAD, clinic)
    guess(client, 5)
    form = {"action": "unlock", "_selected_action": pt.pk}
    for name, is_unlocked in (("oak", False), ("lead", True)):
        lead = Client(REMOTE_ADDR="198.51.100.1")
        enter(lead, username=name)
        lead.post("/admin/rehab/user/", form)
        assert (enter(client).status_code == 302) == is_unlocked


def test_no_password_is_kept_with_a_wrong_try(client, pt):
    guess(client, 1)
    enter(client)
    names = ("new_password1", "new_password2")
    client.post("/account/password/", {"old_password": "tpyo"} | dict.fromkeys(names, "sesame-99"))
    kept = " ".join(str(vars(row)) for row in SignInAttempts.everywhere.all())
    assert SignInAttempts.everywhere.exists()
    for secret in ("wrong", "tpyo", "sesame", "rosa", "127.0.0.1"):
        assert secret not in kept


@pytest.mark.parametrize(
    ("proxies", "forwarded", "address"),
    [
        (0, "", "10.0.0.7"),
        (0, "203.0.113.9", "10.0.0.7"),  # nobody before us: the client made it up
        (1, "203.0.113.9", "203.0.113.9"),
        (1, "1.1.1.1, 203.0.113.9", "203.0.113.9"),  # what is further left is the client's word
        (2, "1.1.1.1, 203.0.113.9, 192.0.2.4", "203.0.113.9"),
        (2, "203.0.113.9", "203.0.113.9"),
        (1, "", "10.0.0.7"),
        (1, "nonsense", "0.0.0.0"),  # noqa: S104
        (1, "2001:db8:1:2:3:4:5:6", "2001:db8:1:2::"),  # one client has the whole network
        (1, "::ffff:203.0.113.9", "203.0.113.9"),
    ],
)
def test_the_address_is_the_one_that_our_own_proxy_saw(settings, proxies, forwarded, address):
    settings.PROXIES = proxies
    headers = {"HTTP_X_FORWARDED_FOR": forwarded} if forwarded else {}
    request = RequestFactory().get("/", REMOTE_ADDR="10.0.0.7", **headers)
    assert client_address(request) == address


# --- how long a sign-in lasts ---------------------------------------------------------------------


def minutes_left() -> float:
    return (Session.objects.get().expire_date - timezone.now()).total_seconds() / 60


def away(client: Client, minutes: float) -> None:
    """Let time pass: everything that is known of the sign-in moves into the past."""
    end = Session.objects.get().expire_date - timedelta(minutes=minutes)
    store = client.session
    for name in (LAST_ACTIVITY_AT, SIGNED_IN_AT):
        store[name] -= minutes * 60
    store.save()
    Session.objects.update(expire_date=end)


def test_a_sign_in_ends_where_nobody_is_there(client, pt, settings):
    settings.SESSION_MINUTES = 30
    enter(client)
    away(client, 29)
    assert is_in(client)
    assert minutes_left() > 29.9  # which has put the end off
    away(client, 31)
    assert not is_in(client)


def test_a_sign_in_lasts_no_longer_than_a_working_day(client, pt, settings):
    settings.SESSION_MINUTES = 30
    enter(client)
    for _ in range(24):  # half-hours, with a page in each
        away(client, 29.9)
        assert is_in(client)
    away(client, 2.5)
    assert not is_in(client)


def test_being_there_is_written_down_once_a_minute(client, pt, django_assert_num_queries):
    enter(client)
    with django_assert_num_queries(2):  # the browser session; the account with its clinic
        client.get("/account/password/")
    away(client, 2)
    client.get("/account/password/")
    assert client.session[LAST_ACTIVITY_AT] == pytest.approx(timezone.now().timestamp(), abs=5)


def test_whoever_reads_the_database_has_no_key_of_a_sign_in(client, pt):
    enter(client)
    assert is_in(client)
    stored = Session.objects.get().session_key
    assert stored != client.cookies["sessionid"].value
    thief = Client()
    thief.cookies["sessionid"] = stored
    assert not is_in(thief)
    assert is_in(client)
    client.post("/sign-out/")
    assert not Session.objects.filter(session_key=stored).exists()


# --- the own password ---------------------------------------------------------------------------


def change(client: Client, old: str, new: str):
    form = {"old_password": old, "new_password1": new, "new_password2": new}
    return client.post("/account/password/", form)


def test_a_new_password_ends_every_other_sign_in(client, pt):
    elsewhere = Client()
    for one in (client, elsewhere):
        enter(one)
    assert change(client, PASSWORD, "other words 2027").status_code == 302
    assert is_in(client)
    assert not is_in(elsewhere)
    enter(elsewhere, "other words 2027")
    assert is_in(elsewhere)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("wrong", "other words 2027", "That is not your password"),
        (PASSWORD, "short", "at least 12 characters"),
        (PASSWORD, "123456789012", "entirely numeric"),
        (PASSWORD, "password1234", "too common"),
    ],
)
def test_a_new_password_needs_the_old_one_and_has_to_be_good(client, pt, old, new, said):
    enter(client)
    assert said in change(client, old, new).content.decode()
    pt.refresh_from_db()
    assert pt.check_password(PASSWORD)


def test_guessing_the_old_password_at_an_open_screen_is_counted(client, pt):
    enter(client)
    for _ in range(5):
        answer = change(client, "wrong", "other words 2027")
    assert "Too many wrong attempts" in answer.content.decode()
    assert (
        "Too many wrong attempts" in change(client, PASSWORD, "other words 2027").content.decode()
    )


@pytest.mark.django_db
def test_an_address_stays_known_for_a_month_while_old_failures_are_deleted():
    known, stranger = (attempt_counter.Limit("password", 5, address=address) for address in "ab")
    then = timezone.now()
    attempt_counter.count([known, stranger], then)
    attempt_counter.forget([known], then)
    attempt_counter.count(
        [attempt_counter.Limit("password", 5, address="c")], then + timedelta(days=29)
    )
    assert attempt_counter.is_known(known, then + timedelta(days=29))
    assert not SignInAttempts.everywhere.filter(key=stranger.key).exists()

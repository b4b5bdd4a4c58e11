"""Nobody who has a second factor, or needs one, comes in without it."""

from __future__ import annotations

import re

import pytest
from django.core.management import call_command
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.sign_in.attempt_counter import SignInAttempts
from rehab.people.sign_in.factors import factors
from rehab.people.sign_in.factors.factors import Authenticator, RecoveryCode
from tests.support import accounts
from tests.support.accounts import PASSWORD, add_account, add_app, code_of, is_in

pytestmark = pytest.mark.postgres


# --- accounts -------------------------------------------------------------------------------------


@pytest.fixture
def pt(db: None) -> User:
    return add_account()


@pytest.fixture
def app(pt) -> App:
    """An app of the therapist's, set up a while ago."""
    return App(*add_app(pt))


class App:
    """What shows the codes, and the recovery codes that came with it."""

    def __init__(self, secret: str, recovery_codes: list[str]) -> None:
        self.secret = secret
        self.recovery_codes = recovery_codes

    def code(self, steps_ago: int = 0) -> str:
        return code_of(self.secret, steps_ago)


def enter(client: Client, username: str = "rosa", then: str = "") -> str:
    """Fill in the sign-in page; return where it leads."""
    answer = accounts.enter(client, username=username, next_url=then)
    return str(answer.headers["Location"])


def prove(client: Client, code: str):
    return client.post("/sign-in/code/", {"code": code})


def require(pt: User) -> None:
    pt.clinic.second_factor_required = True
    pt.clinic.save()


def test_the_password_alone_takes_nobody_past_the_second_factor(client, pt, app):
    assert enter(client, then="/patients/new/") == "/sign-in/code/"
    assert not is_in(client)
    assert client.get("/admin/", follow=True).request["PATH_INFO"] == "/sign-in/"
    assert prove(client, "000000").status_code == 200
    assert not is_in(client)
    assert prove(client, app.code()).headers["Location"] == "/patients/new/"
    assert is_in(client)


def test_whoever_has_a_second_factor_cannot_enroll_another_one_while_pending(client, pt, app):
    enter(client)
    for name in ("set-up-second-factor", "add-app", "add-passkey", "account", "recovery-codes"):
        assert client.get(reverse(name)).headers["Location"].startswith("/sign-in/?next="), name
        assert client.post(reverse(name)).headers["Location"].startswith("/sign-in/?next="), name


def test_a_code_counts_once_and_no_earlier_one_after_it(pt, app):
    now = app.code()
    for code, is_good in ((now, True), (now, False), (app.code(steps_ago=1), False)):
        client = Client()
        enter(client)
        prove(client, code)
        assert is_in(client) == is_good


def test_a_recovery_code_lets_in_once(pt, app):
    for is_good in (True, False):
        client = Client()
        enter(client)
        prove(client, app.recovery_codes[3].lower())
        assert is_in(client) == is_good
    assert factors.count_recovery_codes(pt) == 9


def test_a_pending_sign_in_expires(client, pt, app):
    enter(client)
    store = client.session
    store["pending_second_factor"] = store["pending_second_factor"] | {
        "at": timezone.now().timestamp() - 601
    }
    store.save()
    assert prove(client, app.code()).headers["Location"] == "/sign-in/"
    enter(client)
    pt.set_password("other words 2027")
    pt.save()
    assert prove(client, app.code()).headers["Location"] == "/sign-in/"
    assert not is_in(client)


def test_a_key_that_somebody_else_planted_signs_nobody_in(client, pt, app):
    client.get(reverse("sign-in"))
    store = client.session
    store["x"] = 1
    store.save()
    planted = store.session_key
    client.cookies["sessionid"] = planted
    enter(client)
    pending = client.cookies["sessionid"].value
    prove(client, app.code())
    assert is_in(client)
    assert len({planted, pending, client.cookies["sessionid"].value}) == 3
    for key in (planted, pending):
        other = Client()
        other.cookies["sessionid"] = key
        assert not is_in(other)
        prove(other, app.code())
        assert not is_in(other)


def test_codes_are_guessed_five_times_whatever_the_address(pt, app):
    for number in range(5):
        client = Client(REMOTE_ADDR=f"203.0.113.{number}")
        enter(client)
        answer = prove(client, "000000")
    assert answer.status_code == 429
    assert "Too many wrong attempts. Try again in 15 minutes" in answer.content.decode()
    assert prove(client, app.code()).status_code == 429
    assert not is_in(client)
    SignInAttempts.everywhere.update(locked_until=timezone.now())
    prove(client, app.code())
    assert is_in(client)


def test_wrong_passwords_of_strangers_do_not_close_the_second_door(client, pt, app):
    stranger = Client(REMOTE_ADDR="203.0.113.9")
    for _ in range(6):
        stranger.post("/sign-in/", {"username": "rosa", "password": "wrong"})
    enter(client)
    prove(client, app.code())
    assert is_in(client)


def test_no_secret_lies_open_in_the_database(pt, app, settings):
    row = Authenticator.everywhere.get()
    assert app.secret not in row.credential
    hashes = RecoveryCode.everywhere.values_list("code_hash", flat=True)
    assert not set(hashes) & set(app.recovery_codes)
    settings.SECRET_KEY = "another one " * 5  # as for whoever has the database alone
    assert not factors.verify_code(pt, app.code(), timezone.now())
    assert factors.verify_code(pt, app.recovery_codes[0], timezone.now())


# --- setting up ---------------------------------------------------------------------------------


def set_up_app(client: Client):
    """Read the secret from the page and give the code back. Gives the answer and the secret."""
    page = client.get(reverse("add-app")).content.decode()
    secret = re.search(r'class="secret">([^<]+)<', page).group(1).replace(" ", "")
    assert "<svg" in page
    return client.post(reverse("add-app"), {"code": App(secret, []).code()}), secret


def test_an_app_is_kept_once_it_shows_the_right_code(client, pt):
    assert enter(client) == "/start/"
    wrong = client.post(reverse("add-app"), {"code": "000000"})
    assert "This code is not right" in wrong.content.decode()
    assert not factors.authenticators_of(pt).exists()
    kept, secret = set_up_app(client)
    shown = re.findall("<code>([^<]+)</code>", kept.content.decode())
    assert len(shown) == 10
    assert kept.headers["Cache-Control"].count("no-store")
    account = client.get("/account/").content.decode()
    assert "Authenticator app" in account
    assert "10 left" in account
    assert not any(code in account for code in shown)
    assert set_up_app(client)[1] != secret  # a second one has a secret, and no codes, of its own
    assert factors.count_recovery_codes(pt) == 10
    elsewhere = Client()
    assert enter(elsewhere) == "/sign-in/code/"
    prove(elsewhere, shown[0])
    assert is_in(elsewhere)


def test_removing_and_renewing_take_the_password(client, pt, app):
    enter(client)
    prove(client, app.code())
    removal = f"{reverse('remove-authenticator')}?which={Authenticator.everywhere.get().pk}"
    for url in (removal, reverse("recovery-codes")):
        refused = client.post(url, {"password": "wrong"})
        assert "That is not your password" in refused.content.decode()
    renewed = client.post(reverse("recovery-codes"), {"password": PASSWORD})
    shown = re.findall("<code>([^<]+)</code>", renewed.content.decode())
    assert not factors.verify_code(pt, app.recovery_codes[0], timezone.now())
    assert factors.verify_code(pt, shown[0], timezone.now())
    client.post(removal, {"password": PASSWORD})
    assert not factors.authenticators_of(pt).exists()
    assert factors.count_recovery_codes(pt) == 0
    assert enter(Client()) == "/start/"


def test_nobody_removes_what_is_another_ones(client, pt, app):
    add_account("other", Role.LEAD)
    enter(client, "other")
    removal = f"{reverse('remove-authenticator')}?which={Authenticator.everywhere.get().pk}"
    assert client.post(removal, {"password": PASSWORD}).headers["Location"] == "/account/"
    assert factors.authenticators_of(pt).exists()


# --- a clinic that requires it ------------------------------------------------------------------

CLOSED = [
    "/start/",
    "/admin/",
    "/account/",
    "/account/password/",
    "/patients/new/",
    "/tablets/pair/",
]


def test_a_clinic_that_asks_for_one_is_closed_until_it_is_set_up(client, pt):
    require(pt)
    assert enter(client, then="/patients/new/") == reverse("set-up-second-factor")
    for url in CLOSED:
        answer = client.get(url, follow=True)
        assert answer.request["PATH_INFO"] == "/sign-in/", url
    choice = client.get(reverse("set-up-second-factor")).content.decode()
    assert "Elm asks for one" in choice
    assert "Sign out" not in choice  # nobody is in yet
    codes_page = set_up_app(client)[0].content.decode()
    assert 'href="/patients/new/"' in codes_page
    for url in CLOSED:
        assert client.get(url).status_code == 200, url


def test_sign_ins_from_before_the_clinic_asked_are_over(client, pt):
    enter(client)
    assert is_in(client)
    assert client.get("/api/v1/patients").status_code == 200
    require(pt)
    assert client.get("/api/v1/patients").status_code == 401
    assert not is_in(client)
    assert enter(client) == reverse("set-up-second-factor")


def test_a_sign_in_by_second_factor_stays_when_the_clinic_begins_to_ask(client, pt, app):
    enter(client)
    prove(client, app.code())
    require(pt)
    assert is_in(client)


def test_the_last_one_stays_where_one_is_required(client, pt, app):
    require(pt)
    enter(client)
    prove(client, app.code())
    removal = f"{reverse('remove-authenticator')}?which={Authenticator.everywhere.get().pk}"
    page = client.post(removal, {"password": PASSWORD}, follow=True).content.decode()
    assert "Add another one first" in page
    assert factors.authenticators_of(pt).exists()


def test_a_lead_asks_for_it_and_helps_whoever_lost_it(client, pt, app):
    lead = add_account("lead", Role.LEAD)
    enter(client, "lead")
    form = {
        "name": "Elm",
        "language": "en",
        "time_zone": "UTC",
        "log_retention_months": 36,
        "second_factor_required": "on",
    }
    client.post(f"/admin/rehab/clinic/{pt.clinic.pk}/change/", form)
    pt.clinic.refresh_from_db()
    assert pt.clinic.second_factor_required
    assert enter(client, "lead") == reverse("set-up-second-factor")
    set_up_app(client)
    form = {"action": "remove_second_factors", "_selected_action": pt.pk}
    client.post("/admin/rehab/user/", form)
    assert not factors.authenticators_of(pt).exists()
    assert factors.authenticators_of(lead).exists()
    assert enter(Client()) == reverse("set-up-second-factor")


@pytest.mark.parametrize(
    ("action", "act"), [("remove_second_factors", "factors"), ("unlock", "unlock")]
)
def test_what_a_lead_does_to_an_accounts_door_is_noted(action, act, client, pt, app):
    lead = add_account("lead", Role.LEAD)
    enter(client, "lead")
    client.post("/admin/rehab/user/", {"action": action, "_selected_action": pt.pk})
    entry = AuditEntry.everywhere.get(act=act)
    assert (entry.by, entry.clinic, entry.about) == (lead, pt.clinic, f"user: {pt}")
    assert entry.address == "127.0.0.0/24"


def test_a_host_is_noted_in_the_accounts_clinic_and_a_hosts_own_account_in_no_clinics(client, pt):
    host = add_account("host", Role.HOST)
    enter(client, "host")
    for account in (pt, host):
        client.post("/admin/rehab/user/", {"action": "unlock", "_selected_action": account.pk})
    noted = AuditEntry.everywhere.filter(act="unlock", by=host).order_by("pk")
    assert [(entry.clinic, entry.about) for entry in noted] == [
        (pt.clinic, f"user: {pt}"),
        (None, "user: host"),
    ]


@pytest.mark.parametrize(("hosted", "then"), [(False, "/admin/"), (True, "second factor")])
def test_a_hosted_servers_hosts_always_need_one(client, db, settings, monkeypatch, hosted, then):
    settings.HOSTED = hosted
    monkeypatch.setenv("DJANGO_SUPERUSER_PASSWORD", PASSWORD)
    call_command("createsuperuser", "--no-input", username="host", email="host@example.org")
    where = reverse("set-up-second-factor") if hosted else then
    assert enter(client, "host") == where


def test_passkeys_are_offered_where_browsers_have_them(client, pt, settings):
    settings.ALLOWED_HOSTS = ["*"]
    enter(client)
    for host, secure, is_offered in (
        ("garry.example", True, True),
        ("garry.example", False, False),
        ("localhost:8000", False, True),
        ("192.168.1.5", True, False),
        ("[::1]:8000", True, False),
    ):
        page = client.get("/account/", secure=secure, headers={"host": host}).content.decode()
        assert (reverse("add-passkey") in page) == is_offered, host
        form = client.get(reverse("add-passkey"), secure=secure, headers={"host": host})
        assert (form.status_code == 200) == is_offered

"""What lets a stranger stay in, or takes data out, asks for the password once more."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from rehab.people.audit.audit_log import AuditEntry
from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in import resets
from rehab.people.sign_in.factors import factors, passkeys
from rehab.people.sign_in.factors.factors import Authenticator
from rehab.people.sign_in.step_up import CONFIRMED_AT, LIFETIME
from rehab.people.sign_in.tokens import ApiToken
from tests.support.accounts import PASSWORD, add_account, add_app, code_of, enter
from tests.support.world import signed_in

pytestmark = pytest.mark.django_db
NEW = "other words 2027"


@pytest.fixture
def lead() -> User:
    return add_account("lena", Role.LEAD)


@pytest.fixture
def pt() -> User:
    return add_account()


def wait(client: Client, **passed: float) -> None:
    """Let time pass since the password was shown."""
    store = client.session
    store[CONFIRMED_AT] -= timedelta(**passed).total_seconds()
    store.save()


def asks(answer: Any) -> bool:
    """Whether an answer leads to the page that asks for the password."""
    return "/account/confirm/" in answer.headers.get("Location", "")


def confirm(client: Client, answer: Any, password: str = PASSWORD) -> Any:
    """Type the password into the page that an answer leads to."""
    return client.post(answer.headers["Location"], {"password": password})


def calls(lead: User, pt: User) -> dict[str, tuple[str, str, dict[str, Any]]]:
    """Return each act that asks: method, address and form."""
    patient = Patient.everywhere.create(
        clinic=lead.clinic, code="E1", nickname="Ana", paretic_side="left"
    )
    token = ApiToken(clinic=lead.clinic, user=lead, name="board", role=Role.LEAD)
    token.new_token()
    token.save()
    renew = {"action": "renew_tokens", "_selected_action": token.pk}
    end = {"action": "revoke_tokens", "_selected_action": token.pk}
    remove = {"action": "remove_second_factors", "_selected_action": pt.pk}
    password = reverse("admin:auth_user_password_change", args=[pt.pk])
    account = reverse("admin:rehab_user_change", args=[pt.pk])
    erasing = {"reason": "asked", "code": "E1"}
    first_tablet = f"{reverse('first-steps')}?step=tablet"
    return {
        "choosing a factor": ("get", reverse("set-up-second-factor"), {}),
        "adding an app": ("get", reverse("add-app"), {}),
        "adding a passkey": ("get", reverse("add-passkey"), {}),
        "minting a token": ("get", reverse("admin:rehab_apitoken_add"), {}),
        "renewing a token": ("post", reverse("admin:rehab_apitoken_changelist"), renew),
        "ending a token": ("post", reverse("admin:rehab_apitoken_changelist"), end),
        "ending a program": ("post", reverse("end-program", args=[patient.pk]), {}),
        "revealing an arm": ("post", reverse("reveal", args=[1]), {"reason": "curious"}),
        "an incident's file": ("get", reverse("incident-file", args=[1]), {}),
        "a device's token": ("get", reverse("admin:rehab_device_add"), {}),
        "another's password": ("get", password, {}),
        "another's factors": ("post", reverse("admin:rehab_user_changelist"), remove),
        "a new account": ("get", reverse("admin:rehab_user_add"), {}),
        "another's role": ("post", account, {"username": "rosa", "role": "lead"}),
        "letting a tablet in": ("get", reverse("pair"), {}),
        "a phone as a sensor": ("get", reverse("pair-phone"), {}),
        "trying a phone": ("post", reverse("open-trial-phone"), {}),
        "a trial's tablet": ("post", reverse("try-phone"), {"code": "XXXXXX"}),
        "letting the first tablet in": ("post", first_tablet, {"code": "XXXXXX"}),
        "a family's link": ("get", reverse("family-links", args=[patient.pk]), {}),
        "a patient's file": ("get", reverse("patient-data", args=[patient.pk]), {}),
        "the export's page": ("get", reverse("export"), {}),
        "the export": ("get", reverse("export-sessions"), {}),
        "erasing": ("post", reverse("erase", args=[patient.pk]), erasing),
    }


def test_after_ten_minutes_each_dangerous_act_asks_for_the_password(lead, pt, settings):
    settings.ALLOWED_HOSTS = ["localhost"]
    client = signed_in(lead)
    client.defaults["HTTP_HOST"] = "localhost"  # passkeys need a name
    acts = calls(lead, pt)
    for name, (method, url, form) in acts.items():
        wait(client, seconds=LIFETIME.total_seconds())
        answer = getattr(client, method)(url, form)
        assert asks(answer), name
        confirm(client, answer)
        assert not asks(getattr(client, method)(url, form)), name


def test_a_wrong_password_confirms_nothing_and_counts(lead):
    client = signed_in(lead)
    wait(client, minutes=10)
    asked = client.get(reverse("add-app"))
    for _ in range(4):
        assert "That is not your password" in confirm(client, asked, "wrong").content.decode()
    assert confirm(client, asked, "wrong").status_code == 429
    assert confirm(client, asked).status_code == 429
    assert asks(client.get(reverse("add-app")))


def test_the_password_leads_back_to_where_one_was(lead):
    client = signed_in(lead)
    wait(client, minutes=10)
    page = f"{reverse('admin:rehab_apitoken_add')}?name=board"
    assert confirm(client, client.get(page)).headers["Location"] == page
    wait(client, minutes=10)
    headers = {"referer": "http://testserver/patients/7/records/"}
    download = client.get(reverse("export-sessions"), headers=headers)
    assert confirm(client, download).headers["Location"] == headers["referer"]


@pytest.mark.parametrize("next_url", ["https://evil.example/", "//evil.example/", ""])
def test_the_password_leads_to_no_foreign_page(lead, next_url):
    client = signed_in(lead)
    url = f"{reverse('confirm')}?next={next_url}"
    assert client.post(url, {"password": PASSWORD}).headers["Location"] == "/"
    wait(client, minutes=10)
    asked = client.get(reverse("export-sessions"), headers={"referer": next_url})
    assert confirm(client, asked).headers["Location"] == "/"


# --- by a factor --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["app", "recovery code"])
def test_a_code_counts_like_the_password_and_once(kind, lead):
    secret, recovery_codes = add_app(lead)
    code = code_of(secret) if kind == "app" else recovery_codes[0]
    client = signed_in(lead)
    wait(client, minutes=10)
    asked = client.get(reverse("add-app"))
    url = asked.headers["Location"]
    assert 'name="code"' in client.get(url).content.decode()
    assert client.post(url, {"code": code}).headers["Location"] == reverse("add-app")
    assert not asks(client.get(reverse("add-app")))
    assert "or has been used" in client.post(url, {"code": code}).content.decode()


def test_wrong_codes_lock_as_they_do_at_the_sign_in(lead):
    secret, _ = add_app(lead)
    client = signed_in(lead)
    url = reverse("confirm")
    assert [client.post(url, {"code": "000000"}).status_code for _ in range(5)][3:] == [200, 429]
    right = code_of(secret)
    assert client.post(url, {"code": right}).status_code == 429
    assert client.post(reverse("recovery-codes"), {"code": right}).status_code == 429
    assert client.post(url, {"password": PASSWORD}).status_code == 302  # counted by itself


def test_a_passkey_counts_like_the_password(lead, monkeypatch):
    add_app(lead)
    client = signed_in(lead)
    url = reverse("confirm")
    refused = client.post(url, {"passkey": "{}"})
    assert refused.status_code == 200
    assert AuditEntry.everywhere.get(act="sign_in_failed").by == lead
    wait(client, minutes=10)
    verified = []
    monkeypatch.setattr(passkeys, "verify", lambda *given: verified.append(given[1:3]))
    assert client.post(url, {"passkey": "signed"}).status_code == 302
    assert verified == [(lead, "signed")]
    assert not asks(client.get(reverse("add-app")))


def test_an_account_without_a_password_shows_a_code(lead):
    secret, _ = add_app(lead)
    lead.set_unusable_password()
    lead.save()
    client = signed_in(lead)
    page = client.get(reverse("confirm")).content.decode()
    assert 'name="password"' not in page
    assert client.post(reverse("confirm"), {"password": ""}).status_code == 200
    assert client.post(reverse("confirm"), {"code": code_of(secret)}).status_code == 302


def test_nothing_shown_confirms_nothing(lead):
    client = signed_in(lead)
    wait(client, minutes=10)
    for form in ({}, {"password": ""}, {"code": "000000"}, {"passkey": "{}"}):
        assert client.post(reverse("confirm"), form).status_code == 200
    assert asks(client.get(reverse("add-app")))


# --- factors ------------------------------------------------------------------------------------


def enroll_app(client: Client) -> None:
    client.get(reverse("add-app"))
    secret = client.session["app_secret"]
    assert client.post(reverse("add-app"), {"code": code_of(secret)}).status_code in {200, 302}


def test_adding_a_factor_ends_every_other_sign_in(pt):
    thief, owner = signed_in(pt), signed_in(pt)
    enroll_app(owner)
    assert owner.get("/start/").status_code == 200
    assert thief.get("/start/").status_code == 302


def test_a_second_factor_ends_a_sign_in_that_waits_for_the_first_one(pt):
    thief = Client()
    add_app(pt)
    enter(thief)
    assert thief.get("/sign-in/code/").status_code == 200
    enroll_app(signed_in(pt))
    assert thief.get("/sign-in/code/").headers["Location"] == "/sign-in/"


# --- a lead's own account -----------------------------------------------------------------------


def remove_factors(client: Client, *users: User) -> str:
    form = {"action": "remove_second_factors", "_selected_action": [user.pk for user in users]}
    return client.post("/admin/rehab/user/", form, follow=True).content.decode()


def set_password(client: Client, user: User) -> Any:
    form = {"password1": NEW, "password2": NEW, "usable_password": "true"}
    return client.post(reverse("admin:auth_user_password_change", args=[user.pk]), form)


def has_new_password(user: User) -> bool:
    user.refresh_from_db()
    return user.check_password(NEW)


def test_nobody_sheds_the_own_factor_in_the_admin(lead, pt):
    for user in (lead, pt):
        add_app(user)
    assert "Change your own on the page Your account" in remove_factors(signed_in(lead), lead, pt)
    assert [one.user for one in Authenticator.everywhere.all()] == [lead]


def test_nobody_sets_the_own_password_without_the_old_one(lead, pt):
    client = signed_in(lead)
    answer = set_password(client, lead)
    assert answer.headers["Location"] == reverse("own-password")
    assert not has_new_password(lead)
    set_password(client, pt)
    assert has_new_password(pt)


# --- resets by hosts ----------------------------------------------------------------------------


@pytest.fixture
def host() -> User:
    return add_account("hugo", Role.HOST)


@pytest.fixture
def second_host() -> User:
    return add_account("helga", Role.HOST)


def confirm_reset(client: Client, request_id: int) -> None:
    client.post(reverse("confirm-reset"), {"which": request_id})


def test_a_host_alone_resets_nobody(host, lead, pt):
    client = signed_in(host)
    for user in (lead, pt):  # a lead made a therapist, reset and made a lead again is one, too
        add_app(user)
        assert "has to confirm this" in remove_factors(client, user)
        assert set_password(client, user).status_code == 302
        assert not has_new_password(user)
        assert factors.authenticators_of(user).exists()
        confirm_reset(client, resets.ResetRequest.everywhere.get(account=user).pk)
        remove_factors(client, user)
        assert factors.authenticators_of(user).exists()


@pytest.mark.parametrize("who", ["the lead", "a second host"])
def test_a_host_resets_once_what_the_lead_or_a_second_host_confirms(who, host, second_host, lead):
    client, confirmer = signed_in(host), signed_in(lead if who == "the lead" else second_host)
    set_password(client, lead)
    page = confirmer.get("/account/").content.decode()
    assert "hugo" in page
    assert "Confirm the reset" in page
    confirm_reset(confirmer, resets.ResetRequest.everywhere.get().pk)
    entry = AuditEntry.everywhere.get(act="reset")
    assert (entry.clinic, entry.about) == (lead.clinic, "user: lena")
    set_password(client, lead)
    assert has_new_password(lead)
    add_app(lead)
    remove_factors(client, lead)  # for which it was not confirmed
    assert factors.authenticators_of(lead).exists()


def test_others_confirm_no_reset(host, lead, pt):
    set_password(signed_in(host), lead)
    request = resets.ResetRequest.everywhere.get()
    other = add_account("oskar", Role.LEAD, Clinic.everywhere.create(name="Oak"))
    for user in (pt, other):
        client = signed_in(user)
        assert "Confirm the reset" not in client.get("/account/").content.decode()
        confirm_reset(client, request.pk)
    set_password(signed_in(host), lead)
    assert not has_new_password(lead)


def test_a_confirmation_lasts_an_hour_and_a_request_a_day(host, second_host, lead):
    now = timezone.now()
    assert not resets.may_reset(host, lead, now)
    (request,) = resets.requests_for(lead, now)
    assert not resets.requests_for(lead, now + timedelta(hours=25))
    assert not resets.requests_for(host, now)
    assert resets.confirm_request(second_host, request.pk, now)
    assert not resets.may_reset(host, lead, now + timedelta(minutes=61))
    assert not resets.may_reset(host, lead, now)  # asked anew: the old confirmation is gone

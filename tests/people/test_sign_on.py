"""What comes back from a hospital's sign-on: whose account it is, and what is not believed."""

from __future__ import annotations

from datetime import timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from django.urls import reverse
from joserfc import jwt
from joserfc.jwk import KeySet, RSAKey

from rehab.people.models import Clinic, SignOnGroup, User
from rehab.people.roles import Role
from rehab.people.sign_in import sign_on, step_up
from rehab.people.sign_in.sign_on import LOGOUT_EVENT, SignOnRefused
from rehab.studies.blinding import Task, give_mark
from tests.support.studies import running_study
from tests.support.world import NOW, signed_in

ISSUER = "https://hospital.example"
KEY = RSAKey.generate_key(2048, {"kid": "1"})
OTHER_KEY = RSAKey.generate_key(2048, {"kid": "1"})


@pytest.fixture(autouse=True)
def hospital(settings, monkeypatch):
    settings.OIDC_ISSUER = ISSUER
    keys = KeySet([KEY]).as_dict(private=False)
    known = SimpleNamespace(
        fetch_jwk_set=lambda: keys, load_server_metadata=lambda: {"issuer": ISSUER}
    )
    monkeypatch.setattr(sign_on, "client", lambda *_: known)


@pytest.fixture
def linked(world) -> User:
    SignOnGroup.everywhere.all().delete()
    user: User = world.people[Role.PT]
    user.subject = "4711"
    user.save()
    return user


def group(user: User, name: str, role: Role) -> None:
    SignOnGroup.everywhere.create(name=name, clinic=user.clinic, role=role)


def test_an_account_is_found_by_its_subject_and_by_nothing_else(linked):
    assert sign_on.find_account({"sub": "4711"}) == linked
    for claims in ({"sub": "4712", "preferred_username": linked.username}, {"sub": ""}):
        with pytest.raises(SignOnRefused, match="No account here is linked"):
            sign_on.find_account(claims)


def test_the_strongest_group_of_the_own_clinic_gives_the_role(linked):
    group(linked, "gait", Role.RESEARCHER)
    group(linked, "chiefs", Role.LEAD)
    far = Clinic.everywhere.create(name="far")
    SignOnGroup.everywhere.create(name="elsewhere", clinic=far, role=Role.LEAD)
    found = sign_on.find_account({"sub": "4711", "groups": ["gait", "chiefs"]})
    assert found.role == Role.LEAD
    assert sign_on.find_account({"sub": "4711", "groups": "gait"}).role == Role.RESEARCHER
    before = User.everywhere.get(pk=linked.pk).get_session_auth_hash()
    for groups in ([], ["elsewhere"], ["cardiology"]):
        with pytest.raises(SignOnRefused, match="no group of your clinic"):
            sign_on.find_account({"sub": "4711", "groups": groups})
    assert User.everywhere.get(pk=linked.pk).get_session_auth_hash() != before  # signed out


def test_no_group_makes_an_assessor_a_lead(linked, world):
    give_mark(running_study(world), linked, Task.ASSESSOR, None, NOW)
    group(linked, "chiefs", Role.LEAD)
    with pytest.raises(SignOnRefused, match="end the mark"):
        sign_on.find_account({"sub": "4711", "groups": ["chiefs"]})
    assert User.everywhere.get(pk=linked.pk).role == Role.PT


def test_an_account_that_is_off_stays_off(linked):
    User.everywhere.filter(pk=linked.pk).update(is_active=False)
    with pytest.raises(SignOnRefused, match="switched off"):
        sign_on.find_account({"sub": "4711"})


def test_accounts_are_made_only_where_the_host_says_so(linked, settings):
    group(linked, "gait", Role.PT)
    claims = {"sub": "4712", "preferred_username": linked.username, "groups": ["gait"]}
    with pytest.raises(SignOnRefused):
        sign_on.find_account(claims)
    settings.OIDC_CREATE = True
    made = sign_on.find_account(claims)
    assert (made.username, made.role, made.clinic) == (f"{linked.username}-2", "pt", linked.clinic)
    assert not made.has_usable_password()
    with pytest.raises(SignOnRefused):
        sign_on.find_account({"sub": "4713", "groups": ["cardiology"]})


def test_an_assessor_gets_no_second_account(linked, world, settings):
    """Whose own is not linked, or not any more; the mark would stay with that one."""
    group(linked, "gait", Role.PT)
    settings.OIDC_CREATE = True
    give_mark(running_study(world), linked, Task.ASSESSOR, None, NOW)
    assert sign_on.find_account({"sub": "4712", "groups": ["gait"]}) != linked
    linked.subject = None
    linked.save()
    with pytest.raises(SignOnRefused, match="An assessor of your clinic has not linked"):
        sign_on.find_account({"sub": "4711", "groups": ["gait"]})


@pytest.mark.parametrize(
    ("claims", "shown"),
    [({}, False), ({"acr": "gold"}, True), ({"amr": ["pwd", "mfa"]}, True), ({"acr": "1"}, False)],
)
def test_a_second_factor_counts_where_the_hospital_vouches_for_it(claims, shown, settings):
    settings.OIDC_MFA_ACR = ["gold"]
    assert sign_on.has_second_factor(claims) is shown


@pytest.fixture
def back(linked, client, monkeypatch) -> Any:
    """A person who comes back from the hospital, there for this, with these claims."""

    def come_back(kind: str, **claims: Any) -> Any:
        purpose = {"kind": kind, "next_url": reverse("account"), "at": int(NOW.timestamp())}
        monkeypatch.setattr(sign_on, "complete", lambda _: (purpose, {"sub": "4711"} | claims, {}))
        return client.get(reverse("sign-on-complete"))

    return come_back


def test_the_hospitals_second_factor_stands_for_the_own_one(back, client):
    back("sign-in", amr=["mfa"])
    assert client.get(reverse("account")).status_code == 200


def test_without_it_the_own_second_factor_is_asked_for(back, client):
    assert back("sign-in", amr=["pwd"]).url != reverse("account")
    assert client.get(reverse("account")).status_code == 302


@pytest.mark.parametrize("subject", ["4711", None])
def test_only_an_account_that_is_linked_can_confirm_there(linked, subject):
    linked.subject = subject
    linked.save()
    page = signed_in(linked).get(reverse("confirm")).content.decode()
    assert (reverse("sign-on-confirm") in page) is bool(subject)


@pytest.mark.parametrize(
    ("claims", "confirmed"),
    [({}, True), ({"sub": "4712"}, False), ({"auth_time": 1}, False)],
    ids=["same person now", "another person", "long ago"],
)
def test_only_the_same_person_confirms_and_only_now(back, client, linked, claims, confirmed):
    client.force_login(linked)
    session = client.session
    session[step_up.CONFIRMED_AT] = 0
    session.save()
    back("confirm", **{"auth_time": int(NOW.timestamp()) + 1} | claims)
    assert (client.session[step_up.CONFIRMED_AT] != 0) == confirmed


@pytest.mark.parametrize(
    ("auth_time", "shown"), [(None, False), (900, False), (941, True), ("941", False)]
)
def test_an_old_sign_in_there_confirms_nothing(auth_time, shown):
    assert sign_on.was_shown_since({"auth_time": auth_time}, 1000.0) is shown


def logout_token(key: RSAKey = KEY, **changed: Any) -> str:
    claims = {
        "iss": ISSUER, "aud": "garry", "iat": int(NOW.timestamp()), "sub": "4711", "jti": "1",
        "events": {LOGOUT_EVENT: {}},
    } | changed  # fmt: skip
    return jwt.encode({"alg": "RS256", "kid": "1"}, claims, key)


def test_the_hospital_ends_sign_ins(linked, client):
    before = linked.get_session_auth_hash()
    assert (
        client.post(reverse("sign-on-ended"), {"logout_token": logout_token()}).status_code == 200
    )
    assert User.everywhere.get(pk=linked.pk).get_session_auth_hash() != before


@pytest.mark.parametrize(
    "token",
    [
        "",
        "not.a.token",
        logout_token(OTHER_KEY),
        logout_token(iss="https://elsewhere.example"),
        logout_token(aud="another"),
        logout_token(iat=int((NOW - timedelta(minutes=5)).timestamp())),
        logout_token(events={}),
        logout_token(nonce="of an ID token"),
        "eyJhbGciOiJub25lIn0." + logout_token().split(".")[1] + ".",
    ],
    ids=["none", "nonsense", "key", "issuer", "audience", "old", "event", "nonce", "unsigned"],
)
def test_a_forged_end_of_sign_ins_is_refused(linked, client, token):
    before = linked.get_session_auth_hash()
    assert client.post(reverse("sign-on-ended"), {"logout_token": token}).status_code == 400
    assert User.everywhere.get(pk=linked.pk).get_session_auth_hash() == before


def test_who_comes_back_without_having_gone_there_is_refused(world, client):
    answer = client.get(reverse("sign-on-complete"), {"code": "x", "state": "y"}, follow=True)
    assert "was not completed" in answer.content.decode()
    assert "_auth_user_id" not in client.session


def test_who_signed_in_with_a_password_signs_out_here_alone(pt):
    assert pt.post(reverse("sign-out")).url == reverse("sign-in")


def test_without_a_hospital_its_addresses_do_not_exist(world, client, settings):
    settings.OIDC_ISSUER = ""
    for name in ("sign-on", "sign-on-complete"):
        assert client.get(reverse(name)).status_code == 404
    assert client.post(reverse("sign-on-ended")).status_code == 404


def test_a_host_says_which_clinic_a_group_gives(linked):
    host = signed_in(User.everywhere.create_user("host", role=Role.HOST))
    url = reverse("admin:rehab_signongroup_add")
    assert host.get(url).status_code == 200
    host.post(url, {"name": "gait", "clinic": linked.clinic_id, "role": Role.PT})
    assert SignOnGroup.everywhere.get().clinic == linked.clinic

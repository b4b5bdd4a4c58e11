"""A new machine gets a clinic and one account, whose password is told until it is used."""

import pytest
from django.conf import settings as live_settings
from django.core.management import CommandError, call_command

from rehab.people.models import User
from rehab.people.random_codes import random_words
from rehab.people.roles import Role
from rehab.people.sign_in.first_start import first_clinic, first_password, prepare_database

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def data_folder(settings, tmp_path):
    settings.DATA_DIR = tmp_path


def test_the_first_account_leads_the_first_clinic():
    password = first_password()
    account = User.everywhere.get()
    assert account.check_password(password)
    assert password.count("-") == 2  # three words: they are typed on a tablet
    assert (account.role, account.clinic) == (Role.LEAD, first_clinic())
    assert (live_settings.DATA_DIR / "first_password").stat().st_mode & 0o777 == 0o600


def test_the_password_is_told_again_until_it_is_changed():
    password = first_password()
    assert first_password() == password
    account = User.everywhere.get()
    account.set_password("my own words, chosen well")
    account.save()
    assert first_password() is None
    assert not (live_settings.DATA_DIR / "first_password").exists()


def test_the_file_of_the_password_goes_with_the_first_sign_in(client):
    password, file = first_password(), live_settings.DATA_DIR / "first_password"
    User.everywhere.create_user(
        "else", password="my own words", role=Role.PT, clinic=first_clinic()
    )
    client.post("/sign-in/", {"username": "else", "password": "my own words"})
    client.post("/sign-in/", {"username": "pt", "password": "wrong"})
    assert file.exists()
    client.post("/sign-in/", {"username": "pt", "password": password})
    assert not file.exists()
    assert first_password() is None


def test_a_machine_with_accounts_gets_none():
    User.everywhere.create_user("someone", role=Role.LEAD, clinic=first_clinic())
    assert first_password() is None
    assert User.everywhere.count() == 1


def test_createsuperuser_makes_a_host_who_sees_no_patients(monkeypatch):
    monkeypatch.setenv("DJANGO_SUPERUSER_PASSWORD", "my own words, chosen well")
    call_command("createsuperuser", "--no-input", username="host", email="host@example.org")
    host = User.everywhere.get()
    assert (host.role, host.clinic, host.is_superuser) == (Role.HOST, None, False)


def test_a_hosted_database_is_never_migrated_behind_the_operators_back(settings, monkeypatch):
    settings.HOSTED = True
    prepare_database()  # up to date: nothing to say
    monkeypatch.setattr(
        "rehab.people.sign_in.first_start.MigrationExecutor.migration_plan",
        lambda *_: [("x", False)],
    )
    with pytest.raises(CommandError, match=r"manage\.py migrate"):
        prepare_database()


def test_a_first_password_has_no_word_that_insults(monkeypatch):
    drawn = iter("nazidafokimutero")
    monkeypatch.setattr("rehab.people.random_codes.secrets.choice", lambda _: next(drawn))
    assert random_words(3) == "dafo-kimu-tero"

"""What identifies a person, looked for in every answer that a researcher gets."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from rehab.people.models import Patient, User
from tests.support.world import Actor

MARK = "zq"  # of the tests' worlds; accounts without it have everyday words for names


def identifying_texts(reader: Actor) -> dict[str, str]:
    """Return the texts that a reader must not get, each with what it is of whom.

    For researchers these are nicknames, codes, animal names and row numbers of patients, and all
    accounts but the own one, of every clinic. Others have none.
    """
    if reader.role != "researcher":
        return {}
    found: dict[str, str] = {}
    for patient in Patient.everywhere.filter(nickname__contains=MARK):
        texts = {
            "number": f"#{patient.pk}",
            "animal name": patient.alias,
            "code": patient.code,
            "nickname": patient.nickname,  # the worlds' patients have it for a code as well
        }
        found |= {text: f"a patient by {what}" for what, text in texts.items() if text}
    for person in User.everywhere.filter(username__contains=MARK).exclude(pk=reader.subject.pk):
        names = (person.username, person.first_name, person.last_name)
        found |= {text: f"a {person.role}" for text in names if text}
    return found


def find_identities(hidden: Mapping[str, str], answer: str) -> Iterator[str]:
    """Return whom an answer names of those that are hidden from its reader.

    A number ends before what is no digit: "#2" is in "#2, left leg", not in the color #22aa44.
    """
    for text, whose in hidden.items():
        ends = "(?![0-9a-fA-F])" if text.startswith("#") else ""
        if text in answer and re.search(re.escape(text) + ends, answer):
            yield whose

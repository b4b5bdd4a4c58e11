"""Sends noise to the API of a clinic and looks at what comes back."""

from __future__ import annotations

import json
import time
from collections import Counter
from typing import Any

import pytest
from django.test import Client

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.token_buckets import TokenBuckets
from rehab.people.web import api_base
from tests.support.api_noise import make_noise
from tests.support.marks import mark
from tests.support.noise import draw
from tests.support.programs import ROOT, program_of
from tests.support.world import build_world, scoped_models

SLOWEST_S = 5.0  # no call may hold the server up


def run_noise(count: int, monkeypatch: pytest.MonkeyPatch) -> str:
    """Send so many calls; fail at the first that is not answered as it should be."""
    monkeypatch.setattr(api_base, "calls", TokenBuckets(10**9, 1e-9))
    mine, theirs = build_world("amber"), build_world("birch")
    program = program_of(mine, Role.PT)
    described = json.loads(Client().get(f"{ROOT}/openapi.json").content)
    paths, schemas = described["paths"], described["components"]["schemas"]
    worlds = (mine, theirs)
    keys = {str(row.pk) for world in worlds for row in world.rows.values()}
    known = sorted(keys | {world.patient.code for world in worlds})
    # The code of their patient may be sent, and so taken for one of mine; the rest never is.
    theirs.patient.nickname = "zqbirchnicknameqz"
    theirs.patient.save()
    marks = [mark(theirs.name, model) for model in scoped_models() if model is not Patient]
    marks += [theirs.patient.nickname, theirs.patient.pseudonym]
    answers: Counter[int] = Counter()
    slowest = 0.0

    for noise in draw(make_noise(paths, schemas, known), count):
        method, path = noise.call.split()
        began = time.perf_counter()
        response: Any = program.client.generic(
            method, noise.address, noise.body, "application/json"
        )
        slowest = max(slowest, time.perf_counter() - began)
        answers[response.status_code] += 1
        text = response.content.decode()
        described_answers = paths[path][method.lower()]["responses"]
        answer = json.loads(text)
        if str(response.status_code) not in described_answers:  # the address became none
            assert response.status_code in (404, 405), (noise, text)
        if response.status_code >= 400:
            assert answer.keys() == {"message", "fields"}, (noise, text)
        assert isinstance(answer, dict | list)
        assert not any(word in text for word in marks), (noise, text)

    assert slowest < SLOWEST_S
    counts = ", ".join(f"{code}: {number}" for code, number in sorted(answers.items()))
    return f"{answers.total()} calls ({counts}), slowest {1000 * slowest:.0f} ms"

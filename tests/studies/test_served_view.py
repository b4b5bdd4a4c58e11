"""A real server shows who must not know an arm the same whichever it is: pages and sockets.

The admin's pages are left to tests/studies/test_same_view.py, which opens every address.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.support.servers import Server, serve
from tests.support.trials import AS_ACCOUNT, FAMILY, LEFT_OUT, PHONES, STALE, TABLETS, VARYING
from tests.support.visitors import HELLO, SOURCE, Visitor

pytestmark = [pytest.mark.server, pytest.mark.timeout(300)]  # of three servers
SETTINGS = {"GARRY_PROXIES": "1"}
Seed = Callable[[bool], tuple[Path, dict[str, Any]]]  # whether the sessions have ended
SEED = """
import json, os
os.environ["GARRY_TEST_CLOCK"] = "{now}"
from django.test.utils import setup_test_environment
from tests.support.trials import Trial, become

setup_test_environment()
trial = Trial(ended={ended})
actors = become(trial, trial.assessor, trial.earlier)
entered = {{
    name: {{
        "cookies": {{
            key: one.value for key, one in client.cookies.items() if key != "garry_pairing"
        }},  # which ends in five minutes
        "token": client.defaults.get("HTTP_AUTHORIZATION", "").removeprefix("Bearer "),
    }}
    for name, client in actors.items()
}}
print(json.dumps({{
    "actors": entered, "addresses": trial.addresses(), "family": trial.family,
    "sessions": [session.pk for session in trial.sessions],
}}))
"""
EXCHANGE = """
from rehab.sessions.models import TrainingSession
from tests.support.trials import Trial

trial = Trial.__new__(Trial)
trial.sessions = list(TrainingSession.everywhere.filter(pk__in={sessions}).order_by("pk"))
trial.study = trial.sessions[0].study_visit.enrollment.study
trial.exchange()
"""


@pytest.fixture(scope="module")
def seed(tmp_path_factory: pytest.TempPathFactory) -> Seed:
    """Return what makes a folder with a blinded trial, and says what its assessor can become."""

    @cache
    def make(is_ended: bool) -> tuple[Path, dict[str, Any]]:
        folder = tmp_path_factory.mktemp("data")
        with serve(folder, settings=SETTINGS) as server:
            now = datetime.now(UTC).isoformat()
            said = server.run_shell(SEED.format(now=now, ended=is_ended))
        return folder, json.loads(said.splitlines()[-1])

    return make


def look(server: Server, trial: dict[str, Any]) -> dict[tuple[str, ...], str]:
    """Return what pages and sockets of the participants answer each actor."""
    seen = {}
    sockets = [
        f"/ws/session/{session}/{page}/"
        for session in trial["sessions"]
        for page in ("patient", "monitor")
    ]
    for name, entered in trial["actors"].items():
        visitor = Visitor(server.url, **entered)
        urls = [url for url in trial["addresses"] if not url.startswith("/admin/")]
        for url in [*urls, *(trial["family"] if name == FAMILY else [])]:
            for method in ("GET", "POST"):
                answer = visitor.request(method, url)
                assert answer.status < 500, url
                place = answer.headers.get("Location", "")
                seen[name, method, url] = f"{answer.status} {place} {answer.text}"
        if name in PHONES:
            seen[name, "socket", SOURCE] = str(visitor.watch(SOURCE, HELLO))
        for url in sockets:
            seen[name, "socket", url] = str(visitor.watch(url))
    return {key: VARYING.sub("", said) for key, said in seen.items()}


def find_differences(
    folder: Path, trial: dict[str, Any], program: Sequence[str]
) -> set[tuple[str, ...]]:
    """Return who is answered otherwise, and where, once the arms are exchanged.

    The first look counts nothing: its own POSTs change what is answered.
    """
    looks = []
    for number in range(3):
        with serve(folder, settings=SETTINGS, program=program) as server:
            looks.append(look(server, trial))
            if number == 1:
                server.run_shell(EXCHANGE.format(**trial))
    _changing, before, after = looks
    assert before.keys() == after.keys()
    assert {name for name, *_ in before} == {*AS_ACCOUNT, *TABLETS, *PHONES, FAMILY, STALE}
    found = {key for key, said in before.items() if after[key] != said}
    for key in found:
        print(*key, before[key], after[key], sep="\n")
    return found


@pytest.mark.long
@pytest.mark.parametrize("is_ended", [False, True])
def test_whatever_an_assessor_becomes_is_answered_the_same(seed, tmp_path, is_ended):
    folder, trial = seed(is_ended)
    copy = shutil.copytree(folder, tmp_path / "data")
    assert find_differences(copy, trial, ["manage.py"]) == set()


@pytest.mark.long
@pytest.mark.parametrize(
    ("rule", "is_ended", "how"),
    [
        ("an assessor lets no device in", False, "socket"),
        ("an assessor sees no sessions", False, "socket"),
        ("a family sees nothing", True, "POST"),  # its page asks for a tap first
    ],
)
def test_a_rule_that_is_left_out_is_found(seed, tmp_path, rule, is_ended, how):
    folder, trial = seed(is_ended)
    leaky = ["-m", "tests.support.leaky_server", rule]
    found = find_differences(shutil.copytree(folder, tmp_path / "data"), trial, leaky)
    refused = {"tablet", "phone"}  # while the rule held
    assert {name for name, *_ in found} == LEFT_OUT[rule][-1] - refused
    assert how in {method for _, method, _ in found}

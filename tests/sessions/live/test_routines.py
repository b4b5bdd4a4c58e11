"""What a running server does from time to time."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import pytest
from asgiref.sync import sync_to_async

from rehab.management.commands.doctor import examine_tasks
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.periodic_tasks import Routines
from rehab.sessions.live.session.prometheus_metrics import REGISTRY
from rehab.sessions.ownership import ClinicOwner
from rehab.sessions.seals import SessionSeal


@pytest.mark.postgres
@pytest.mark.parametrize("is_own", [True, False], ids=["own", "another server's"])
async def test_the_sessions_of_its_clinics_are_sealed(place, sourced, is_own):
    session, source = await sourced(place)
    await source.walk(4.0)
    if not is_own:
        await ClinicOwner.everywhere.filter(clinic=session.clinic_id).aupdate(owner="another")
    await runtimes.current().routines._seal_logs()
    ends = [one.last_step async for one in SessionSeal.everywhere.filter(session=session.pk)]
    assert ends == ([1] if is_own else [])
    await ClinicOwner.everywhere.filter(clinic=session.clinic_id, owner="another").aupdate(owner="")


async def test_each_failure_of_a_task_is_counted_and_it_goes_on():
    asked = []

    async def _break() -> None:
        asked.append(count())
        if len(asked) == 3:
            raise asyncio.CancelledError
        raise RuntimeError("This task always fails.")

    def count() -> float | None:
        return REGISTRY.get_sample_value("garry_task_failures_total", {"task": "break"})

    routines: Any = SimpleNamespace(_loop=asyncio.get_running_loop(), _problems={})
    with suppress(asyncio.CancelledError):
        await Routines._repeat(routines, 0.01, _break)
    assert asked == [0, 1, 2]


async def test_doctor_finds_a_task_that_fails_until_it_does_not(place, begun):
    await begun(place)
    routines = runtimes.current().routines

    async def diagnose() -> list[str]:
        await routines._record_problems()
        found = await sync_to_async(lambda: list(examine_tasks()))()
        return [f"{one.state}: {one.cure}" for one in found if one.cure]

    assert await diagnose() == []
    routines._problems["seal_logs"] = "OSError('No space left')"
    (said,) = await diagnose()
    assert said.startswith("task seal_logs failed, ")
    assert "OSError('No space left') Restart the server" in said
    routines._problems["seal_logs"] = ""
    assert await diagnose() == []

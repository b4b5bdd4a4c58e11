"""What a running server does from time to time."""

from __future__ import annotations

import pytest

from rehab.sessions.live import runtime as runtimes
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

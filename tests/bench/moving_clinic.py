"""A clinic with many steps in a sealed file: `python -m tests.bench.moving_clinic STEPS FILE N`."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

A_SESSION = 1000  # steps

if __name__ == "__main__":
    import django

    django.setup()
    from django.utils import timezone

    from rehab.exports.clinic.sealed_file import seal_everything, write_clinic
    from rehab.exports.encryption import generate_key, read_recipients
    from rehab.people.models import Clinic, Patient
    from rehab.sessions.log import Step
    from rehab.sessions.models import TrainingSession
    from tests.bench.own_database import copy_rows, set_up
    from tests.support.walks import strides, walk

    steps, file, number = int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    set_up()
    clinic = Clinic.everywhere.create(name=f"Mover {number}")
    patient = Patient.everywhere.create(clinic=clinic, code="0", nickname="0", paretic_side="left")
    first = walk(patient, "positive", strides(A_SESSION, A_SESSION // 2))
    count = steps // A_SESSION - 1
    copy_rows(TrainingSession, count, f"t.id = {first.pk}", {"id": f"{first.pk} + i"})
    copy_rows(Step, count, f"t.session_id = {first.pk}", {"session_id": f"{first.pk} + i"})
    began_s = time.process_time()
    seal_everything(clinic, timezone.now())
    sealed_us = 1e6 * (time.process_time() - began_s) / Step.everywhere.count()
    secret, public = generate_key()
    began_s = time.monotonic()
    with file.open("wb") as out:
        rows = write_clinic(clinic, out, read_recipients([public]), timezone.now())
    took_s = time.monotonic() - began_s
    print(
        json.dumps(
            {
                "key": secret,
                "steps": rows.counts["rehab.step"],
                "seal_us_a_step": sealed_us,
                "export_s": took_s,
                "mb": file.stat().st_size / 1e6,
            }
        )
    )

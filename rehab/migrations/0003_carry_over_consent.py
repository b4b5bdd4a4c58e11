"""Nobody is asked anew for what was agreed before consent was kept, and nothing goes dark.

Patients who stand on boards with others had agreed to that: they get the consent row that boards
need now, without words. Clinics that exist go on without consent to research until a lead asks for
it; new ones begin with it.
"""

from typing import Any

from django.db import migrations
from django.utils import timezone


def carry_over(apps: Any, schema_editor: Any) -> None:
    Clinic, Patient, Consent = (
        apps.get_model("rehab", name) for name in ("Clinic", "Patient", "Consent")
    )
    Clinic._base_manager.update(research_needs_consent=False)
    now = timezone.now()
    agreed = Patient._base_manager.exclude(boards="own").values_list("pk", flat=True)
    Consent._base_manager.bulk_create(
        [Consent(patient_id=pk, purpose="boards", given_at=now) for pk in agreed.iterator()],
        batch_size=500,
    )


class Migration(migrations.Migration):
    dependencies = [("rehab", "0002_clinics_own")]

    operations = [migrations.RunPython(carry_over, migrations.RunPython.noop)]

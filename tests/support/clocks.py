"""Run database tests by other clocks than today's: `make test-clocks`.

Each begins as a clock does something rare. What changes nothing with the day (noise, whose rows are
whose) is left to `make test`.
"""

from __future__ import annotations

import os
import subprocess
import sys

CLOCKS = {
    "the next day": ("2026-11-22T10:00:00+00:00", "UTC"),
    "40 days later, another year tomorrow": ("2026-12-31T10:00:00+00:00", "UTC"),
    "a leap day": ("2028-02-29T12:00:00+00:00", "UTC"),
    "before clocks go forward": ("2027-03-28T00:59:58+00:00", "Europe/Berlin"),
    "before clocks go back": ("2026-11-01T05:59:58+00:00", "America/New_York"),
    "before midnight": ("2026-11-21T23:59:50+00:00", "UTC"),
}
TESTS = "database and not browser and not realtime and not bench and not screenshots"
NAMES = "not noise and not tenancy and not stateful and not spoken and not lists"


def main(arguments: list[str]) -> int:
    """Run the tests by each clock; return how many clocks found a fault."""
    failed = []
    for name, (moment, zone) in CLOCKS.items():
        print(f"Database tests by another clock: {name} ({moment}, {zone})", flush=True)
        command = [sys.executable, "-m", "pytest", "-q", "-m", TESTS, "-k", NAMES, *arguments]
        given = os.environ | {"GARRY_TEST_CLOCK": moment, "GARRY_TEST_ZONE": zone}
        if subprocess.run(command, env=given, check=False).returncode:
            failed.append(name)
    if failed:
        print(f"Faults by these clocks: {', '.join(failed)}. Try one again: GARRY_TEST_CLOCK=…")
    return len(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

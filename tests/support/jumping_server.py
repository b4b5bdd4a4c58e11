"""A server whose clock jumps: ``python -m tests.support.jumping_server FILE serve …``.

The file holds by how many seconds it is ahead, and is read again four times a second. What measures
how long something takes (the monotonic clock) does not jump, as on a real machine.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from datetime import timedelta
from pathlib import Path

import time_machine


def _follow(file: Path) -> None:
    before, traveller = "+0", None
    while True:
        ahead = file.read_text()
        if ahead and ahead != before:
            if traveller is not None:
                traveller.stop()
                traveller = None
            if float(ahead):
                traveller = time_machine.travel(timedelta(seconds=float(ahead)), tick=True)
                traveller.start()
            before = ahead
        time.sleep(0.25)


if __name__ == "__main__":
    from django.core.management import execute_from_command_line

    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "garry_site.settings")
    file, *command = sys.argv[1:]
    threading.Thread(target=_follow, args=[Path(file)], daemon=True).start()
    execute_from_command_line(["manage.py", *command])

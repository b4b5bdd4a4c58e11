"""`manage.py` with a rule of blinding left out: `python -m tests.support.leaky_server RULE …`."""

from __future__ import annotations

import sys

import django
from django.core.management import execute_from_command_line

if __name__ == "__main__":
    rule = sys.argv.pop(1)
    django.setup()
    from tests.support.trials import LEFT_OUT

    module, name, left_out, _found = LEFT_OUT[rule]
    setattr(module, name, left_out)
    execute_from_command_line(sys.argv)

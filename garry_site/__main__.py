"""Run GARRY's management commands: `garry serve`, `garry doctor`, `python -m garry_site …`."""

import os
import sys


def main() -> None:
    """Hand the command line to Django."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "garry_site.settings")
    try:
        from django.core.management import execute_from_command_line
    except ModuleNotFoundError as error:
        raise SystemExit(
            f"{error}: a server needs more than a source. Cure: pip install 'garry[server]'"
        ) from error
    execute_from_command_line(sys.argv)


if __name__ == "__main__":
    main()

"""Run GARRY's management commands: `garry serve`, `garry doctor`, `python -m garry_site …`."""

import os
import sys
from importlib.metadata import version

HELP = """\
Usage: {program} COMMAND [options]

  serve        serve a clinic: prints the address and a first password, until Ctrl-C
  demo         serve a simulated clinic with weeks of history, to look around in
  doctor       say what is wrong with this installation, with cures
  backup       store everything in one encrypted file (backupkey makes its key)
  restore      fill a new installation from such a file
  runsession   score a recording or a simulated patient, without pages

{program} COMMAND --help explains one; {program} help --all lists the others."""
SERVER_CURE = (
    "a server needs more than a source. Cure: pip install 'garry[server]', or once, without "
    "installing: uvx --from 'garry[server]' garry serve"
)


def main() -> None:
    """Explain the commands, or hand the command line to Django."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "garry_site.settings")
    match sys.argv[1:]:
        case [] | ["help"] | ["--help"] | ["-h"]:
            print(HELP.format(program=os.path.basename(sys.argv[0])))  # noqa: PTH119
            return
        case ["version"] | ["--version"]:
            print(version("garry"))
            return
        case ["help", "--all"]:
            del sys.argv[2:]
    try:
        from django.core.management import execute_from_command_line
    except ModuleNotFoundError as error:
        raise SystemExit(f"{error}: {SERVER_CURE}") from error
    execute_from_command_line(sys.argv)


if __name__ == "__main__":
    main()

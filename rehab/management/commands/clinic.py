"""`manage.py clinic export | import | remove | verify`: a clinic as a unit that moves."""

from __future__ import annotations

import getpass
import json
import os
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management import BaseCommand, CommandError
from django.utils import timezone

from rehab.exports.clinic.clinic_import import import_clinic
from rehab.exports.clinic.clinic_removal import (
    LEAVES_WITHIN_S,
    PENDING,
    compare_with_file,
    finish_removal,
    last_seals,
    make_receipt,
    remove_clinic,
)
from rehab.exports.clinic.row_serialization import CannotMove, ClinicRows
from rehab.exports.clinic.sealed_file import inspect, write_clinic
from rehab.exports.encryption import CannotDecrypt, InvalidKey, read_recipients
from rehab.management.files import new_file, opened, read_key_file
from rehab.people.audit import audit_log, seals
from rehab.people.audit.audit_log import Act
from rehab.people.audit.moves import ClinicMove
from rehab.people.commands import command
from rehab.people.models import Clinic
from rehab.sessions import seals as session_seals


class Command(BaseCommand):
    """Takes a clinic out, in, away, or compares it."""

    help = "Export, import, remove or verify one clinic."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the subcommands."""
        parts = parser.add_subparsers(dest="part", required=True)
        out = parts.add_parser("export", help="write a clinic into FILE, encrypted")
        out.add_argument("clinic", help="its name")
        out.add_argument("file", type=Path, metavar="FILE")
        out.add_argument("--to", action="append", metavar="KEY", help="age1…, of who takes it in")
        tokens = "with tokens of devices, programs and families; else they need new ones"
        out.add_argument("--tokens", action="store_true", help=tokens)
        into = parts.add_parser("import", help="take in the clinic of FILE")
        into.add_argument("file", type=Path, metavar="FILE")
        into.add_argument("--key", type=Path, required=True, metavar="KEYFILE")
        into.add_argument("--name", default="", help="of the clinic here, if it is to be another")
        away = parts.add_parser("remove", help="remove a clinic, once it is in FILE")
        away.add_argument("clinic", help="its name")
        away.add_argument("certificate", type=Path, help="where to write what is gone")
        away.add_argument("--file", type=Path, metavar="FILE")
        away.add_argument("--key", type=Path, metavar="KEYFILE")
        away.add_argument("--receipt", default="", help="what `import` said there, for FILE")
        away.add_argument("--by", metavar="NAME", help="who removes it, if not by this console")
        away.add_argument("--destroy", action="store_true", help="without a file: all is lost")
        check = parts.add_parser("verify", help="compare a clinic with its seals, and with FILE")
        check.add_argument("clinic", help="its name")
        check.add_argument("--file", type=Path, metavar="FILE")
        check.add_argument("--key", type=Path, metavar="KEYFILE")

    def handle(self, *args: Any, part: str, **options: Any) -> None:
        """Run a subcommand. Raises CommandError, with the cure."""
        if hasattr(os, "nice"):
            os.nice(10)  # sessions of other clinics go first
        try:
            getattr(self, f"_{part}")(**options)
        except CannotDecrypt as problem:
            raise CommandError(f"{options['file']} cannot be read. {problem}") from problem
        except (CannotMove, InvalidKey) as problem:
            raise CommandError(str(problem)) from problem

    def _export(
        self, clinic: str, file: Path, to: list[str] | None, tokens: bool, **_: Any
    ) -> None:
        one, now = _find(clinic), timezone.now()
        recipients = read_recipients(to or settings.BACKUP_KEYS)
        about = f"{command('clinic export')}, to {', '.join(to or settings.BACKUP_KEYS)}"
        audit_log.record(Act.EXPORT, None, clinic_id=one.pk, about=about, now=now)
        with new_file(file) as out:
            rows = write_clinic(one, out, recipients, now, with_tokens=tokens)
        self._tell(f"{file}: {one}", rows.counts)
        if broken := self._report_broken(one):
            self.stderr.write(
                f"{broken} are not as they were sealed; the file has them as they are."
            )

    def _import(self, file: Path, key: Path, name: str, **_: Any) -> None:
        with opened(file) as source:
            log = self.stdout.write
            clinic = import_clinic(source, read_key_file(key), timezone.now(), name=name, log=log)
        self._tell(f"{clinic} is here and as the file says", ClinicRows(clinic.pk).count())
        taken_in = ClinicMove.everywhere.filter(clinic=clinic).order_by("number").last()
        if taken_in is not None:
            said = make_receipt(taken_in.digests)
            self.stdout.write(f"Receipt, by which it may be removed where it was: {said}")
        self.stdout.write(
            "Passwords and authenticator apps go on; recovery codes do not, and passkeys at the "
            "same address alone. Give devices new tokens, unless it was exported with --tokens."
        )

    def _remove(
        self,
        clinic: str,
        certificate: Path,
        file: Path | None,
        key: Path | None,
        destroy: bool,
        receipt: str,
        by: str | None,
        **_: Any,
    ) -> None:
        now = timezone.now()

        def store(text: str) -> None:
            with new_file(certificate) as out:
                out.write(text.encode())

        pending = _read_pending(certificate, clinic)
        half = Clinic.everywhere.filter(name=clinic).first()
        if pending and (half is None or half.removing_at):  # a run before did not come to its end
            digest = finish_removal(half, pending, now, store=store)
            self.stdout.write(f"{clinic} is gone. {certificate}: SHA-256 {digest}.")
            return
        one, content = _find(clinic), None
        if file is None and not destroy and not receipt:
            raise CommandError(
                "Name the file that it leaves with: --file FILE --key KEYFILE; or the --receipt of "
                "where it was taken in."
            )
        if file is not None:
            with opened(file) as source:
                content = inspect(source, read_key_file(key))
        by = by or f"{getpass.getuser()}, server console"
        try:
            digest = remove_clinic(
                one, content, by, now, wait_s=LEAVES_WITHIN_S, store=store, receipt=receipt
            )
        except CommandError as problem:
            if _read_pending(certificate, clinic) is None:
                raise
            raise CommandError(
                f"{clinic} is gone, but its certificate is pending yet. {problem} Make room, then "
                "run the same again to complete it."
            ) from problem
        self.stdout.write(f"{clinic} is gone. {certificate}: SHA-256 {digest}.")

    def _verify(self, clinic: str, file: Path | None, key: Path | None, **_: Any) -> None:
        one = _find(clinic)
        if file is not None:
            with opened(file) as source:
                content = inspect(source, read_key_file(key))
            move = one.moves.filter(file=content.header["file"]).first()
            rows = ClinicRows(one.pk, content.header["tokens"], move)
            compare_with_file(one, content, rows.digest())
            self.stdout.write(f"{one} is as {file} has it.")
        if broken := self._report_broken(one):
            raise CommandError(
                f"{broken} are not as they were sealed. Compare with a backup from before, "
                "and find out who was there."
            )
        self._tell(f"{one} is as it was sealed", ClinicRows(one.pk).count())
        for log, digest in last_seals(one.pk).items():
            self.stdout.write(f"  last seal of {log}: {digest}")

    def _report_broken(self, clinic: Clinic) -> int:
        """Write what is not as it was sealed, the first of many; return how many there are."""
        broken = list(session_seals.find_broken_of(clinic.pk))
        for log in seals.sealed_models():
            broken += seals.find_broken_of(log, clinic.pk)
        for problem in broken[:20]:
            self.stderr.write(problem)
        return len(broken)

    def _tell(self, what: str, counts: dict[str, int]) -> None:
        names = {"patient": "patients", "trainingsession": "sessions", "step": "steps"}
        told = ", ".join(f"{counts[f'rehab.{name}']} {word}" for name, word in names.items())
        self.stdout.write(f"{what}: {told}.")


def _find(name: str) -> Clinic:
    clinic = Clinic.everywhere.filter(name=name).first()
    if clinic is None:
        names = ", ".join(Clinic.everywhere.values_list("name", flat=True)) or "none"
        raise CommandError(f"There is no clinic {name}. Clinics here: {names}.")
    return clinic


def _read_pending(certificate: Path, clinic: str) -> dict[str, Any] | None:
    """Return a clinic's certificate that is pending; None where there is no file."""
    if not certificate.exists():
        return None
    try:
        found: dict[str, Any] = json.loads(certificate.read_text())
        if (found["certificate"], found["clinic"]) == (PENDING, clinic):
            return found
    except (OSError, ValueError, LookupError, TypeError):
        pass
    raise CommandError(f"{certificate} is there already. Name another file.")

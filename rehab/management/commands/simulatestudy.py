"""`manage.py simulatestudy`: a whole study of simulated patients, from the plan to the export."""

from __future__ import annotations

import json
import math
import time
from argparse import ArgumentParser
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

from django.contrib.auth.hashers import make_password
from django.core.management import BaseCommand, CommandError
from django.db import connection
from django.utils import timezone, translation

from rehab.exports.archive import save_zip
from rehab.exports.research.resumable_export import Package
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.commands import command
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.people.sign_in.first_start import prepare_database
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere
from rehab.sessions.live.headless import GIVE_WAY_S, Pace
from rehab.studies.models import Study
from rehab.studies.record.checklists import ITEMS, checklist_rows, checklist_text
from rehab.studies.results.drawing import FIGURES, TABLES, name_pair, write_table
from rehab.studies.results.results import Results
from rehab.studies.results.tables import HEADERS
from rehab.studies.simulation.example import example_trial
from rehab.studies.simulation.study import find_or_plan, finish_study, walk_study
from rehab.studies.simulation.walkers import Population
from rehab.training.measures import InvalidSetting

CLINIC = "Simulated studies"
EXPORT = "export.zip"


class Command(BaseCommand):
    """Plans, randomizes, walks, analyzes and exports a study; a seed gives the same files."""

    help = (
        "Simulate a study of four feedback types through the real path, and write tables (CSV), "
        "figures (SVG), SPIRIT and CONSORT (text) and the export for analysis (ZIP). One that was "
        "broken off goes on."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument(
            "--seed", type=int, default=0, help="the same seed gives the same files"
        )
        parser.add_argument("--participants", type=int, default=60)
        parser.add_argument("--visits", type=int, default=1)
        parser.add_argument(
            "--dropout", type=float, default=0.0, help="share that leaves before each visit"
        )
        parser.add_argument(
            "--clinic", default=CLINIC, help=f"default: {CLINIC!r}, made if missing"
        )
        parser.add_argument(
            "--facts", type=Path, help="JSON: what checklists ask of a study, by name"
        )
        parser.add_argument(
            "--to", type=Path, default=Path("simulated-study"), help="folder of the files"
        )

    def handle(self, *args: Any, **options: Any) -> None:
        """Simulate the study. Raises CommandError, with the cure."""
        prepare_database()
        began = time.perf_counter()
        seed, now = options["seed"], timezone.now()
        try:
            population = Population(dropout=options["dropout"])
            trial = example_trial(options["participants"], options["visits"], population)
            clinic, _is_new = Clinic.everywhere.get_or_create(name=options["clinic"])
            facts = json.loads(options["facts"].read_text("utf-8")) if options["facts"] else {}
            study = find_or_plan(clinic, trial, seed, now, facts)
            give_way = Pace(rest_s=GIVE_WAY_S if connection.vendor == "sqlite" else 0.0)
            for done in walk_study(study, trial, seed, now, give_way):
                self._tell(f"{done} of {trial.participants} participants")
            results = finish_study(study, now)
        except (InvalidSetting, OwnedElsewhere) as problem:
            raise CommandError(str(problem)) from problem
        self.stderr.write("")
        with translation.override("en"):
            digest = write_files(results, options["to"])
            self.stdout.write(describe(results, trial.effects))
        self._export(study, options["to"] / EXPORT, now)
        self.stdout.write(
            f"{options['to']}: SHA-256 of all tables and figures {digest}, and {EXPORT}\n"
            f"{time.perf_counter() - began:.0f} s"
        )

    def _tell(self, progress: str) -> None:
        self.stderr.write(f"\r{progress}", ending="")
        self.stderr.flush()

    def _export(self, study: Study, file: Path, now: datetime) -> None:
        """Write the study's export for analysis, by an account with which nobody can sign in."""
        name = f"simulated-study-{study.clinic.pk}"
        given = {"role": Role.LEAD, "clinic": study.clinic, "password": make_password(None)}
        user, _is_new = User.everywhere.get_or_create(username=name, defaults=given)
        about = command("simulatestudy")
        audit_log.record(Act.EXPORT, None, clinic_id=study.clinic.pk, about=about, now=now)
        folder = file.with_name(file.name + ".parts")
        package = Package.create(folder, user, study, shift_dates=False, now=now)
        for done, total in package.advance(math.inf):
            self._tell(f"{done} of {total} sessions exported")
        self.stderr.write("")
        save_zip(package.files(), file)
        package.discard()


def write_files(results: Results, folder: Path) -> str:
    """Write tables, figures and checklists; return the digest of the tables and figures."""
    files = {
        f"{name}.csv": write_table(rows(results), HEADERS.get(name, ()))
        for name, rows in TABLES.items()
    }
    files |= {f"{name}.svg": draw(results) for name, draw in FIGURES.items()}
    folder.mkdir(parents=True, exist_ok=True)
    digest = sha256()
    for name, text in sorted(files.items()):
        (folder / name).write_bytes(text.encode())  # the same on Windows, too
        digest.update(f"{name}\n{text}".encode())
    lists = list(checklist_rows(results.study, results))
    for name in ITEMS:  # which tell the day, so that they are not in the digest
        (folder / f"{name}.txt").write_text(checklist_text(lists, name), "utf-8")
    return digest.hexdigest()


def describe(results: Results, effects: Any) -> str:
    """Return the primary outcome's differences beside what was put in, as text."""
    lines = [f"{results.study.code}: {results.primary}, differences in %"]
    for one in results.find(results.primary).differences:
        true = effects[one.group] - effects[one.reference]
        found = one.difference
        interval = "" if found.low is None else f" [{found.low:6.2f}, {found.high:6.2f}]"
        pair = name_pair(results, one.group, one.reference)
        lines.append(f"  {pair:<12} {found.estimate:6.2f}{interval}   put in: {true:5.1f}")
    return "\n".join(lines)

"""`manage.py studypower`: how often a planned study would find an effect that is there."""

from __future__ import annotations

import os
import threading
from argparse import ArgumentParser, ArgumentTypeError
from typing import Any

from django.core.management import BaseCommand, CommandError
from django.utils import timezone

from rehab.people.sign_in.first_start import prepare_database
from rehab.studies.models import Study
from rehab.studies.power_runs import PowerRun, plan_run, work
from rehab.training.measures import InvalidSetting


def parse_effects(text: str) -> dict[str, float]:
    """Return the effects of "A=0,B=8". Raises ArgumentTypeError."""
    try:
        pairs = (one.split("=") for one in text.split(",") if one.strip())
        return {arm.strip(): float(effect) for arm, effect in pairs}
    except ValueError:
        raise ArgumentTypeError("give each arm's effect in % of baseline, as A=0,B=8") from None


class Command(BaseCommand):
    """Simulates studies, stores what each found, and prints the power; resumable."""

    help = (
        "Simulate a planned study from seeds 0, 1, 2 … with simulated patients that answer "
        "feedback, and print how often it finds the effects. --run goes on with one."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("study", nargs="?", help="short name of the study")
        parser.add_argument("--clinic", help="its clinic, where several have that name")
        parser.add_argument("--run", type=int, help="number of a run to go on with")
        parser.add_argument("--effects", type=parse_effects, default={}, metavar="A=0,B=8")
        parser.add_argument("--participants", type=int, help="default: as planned")
        parser.add_argument("--simulations", type=int, default=200)
        parser.add_argument(
            "--child",
            action="store_true",
            help="end with the server, and let its sessions go first",
        )
        parser.add_argument("--sd", type=float, default=10.0, help="between people, %% of baseline")
        parser.add_argument("--kept", type=float, default=25.0, help="%% that washout keeps")
        parser.add_argument("--dropout", type=float, default=0.0, help="%% before each visit")

    def handle(self, *args: Any, **options: Any) -> None:
        """Simulate. Raises CommandError, with the cure."""
        prepare_database()
        if options["child"]:
            live_with_parent()
        try:
            run = find_run(options)
            for stored in work(run):
                self.stderr.write(f"\r{stored.done} of {stored.simulations} studies", ending="")
                self.stderr.flush()
        except InvalidSetting as problem:
            raise CommandError(str(problem)) from problem
        self.stderr.write("")
        self.stdout.write(f"Run {run.pk} of {run.study.code}: {run.done} studies")
        for one in run.power:
            self.stdout.write(
                f"  {one.group} − {one.reference}: power {one.power:.0%} "
                f"[{one.low:.0%}, {one.high:.0%}], mean difference {one.estimate:.2f}"
            )


def live_with_parent() -> None:
    """Leave the processor to live sessions first; end when standard input does: with the server.

    What a study found is stored in one transaction, so that an end at any moment harms nothing.
    """
    if hasattr(os, "nice"):  # Windows has none
        os.nice(10)

    def watch() -> None:
        while os.read(0, 4096):  # not sys.stdin: Python aborts where a thread holds its lock
            pass
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def find_run(options: dict[str, Any]) -> PowerRun:
    """Return the run that is asked for, or a new one. Raises CommandError, InvalidSetting."""
    if options["run"] is not None:
        run = PowerRun.everywhere.select_related("study").filter(pk=options["run"]).first()
        if run is None:
            raise CommandError(f"There is no run {options['run']}.")
        return run
    studies = Study.everywhere.filter(code=options["study"] or "")
    if options["clinic"]:
        studies = studies.filter(clinic__name=options["clinic"])
    found = list(studies[:2])
    if len(found) != 1:
        known = ", ".join(Study.everywhere.values_list("code", flat=True)[:10])
        raise CommandError(
            f"Name one study (and its --clinic where several have that name). Known: {known}."
        )
    settings = {
        "effects": options["effects"],
        "participants": options["participants"] or found[0].participants,
        "sd_percent": options["sd"],
        "kept_percent": options["kept"],
        "dropout_percent": options["dropout"],
    }
    return plan_run(found[0], settings, options["simulations"], None, timezone.now())

"""`manage.py runsession`: score a recording or a simulated patient without pages."""

from __future__ import annotations

import asyncio
import json
import math
import time
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from django.core.management import BaseCommand, CommandError

from rehab.people.models import Clinic, Patient
from rehab.people.sign_in.first_start import first_clinic, prepare_database
from rehab.sessions.live.database.clinic_owners import OwnedElsewhere, find_elsewhere
from rehab.sessions.live.headless import (
    Pace,
    robot_steps,
    run_session,
    session_report,
    simulate_strides,
)
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.sessions.state_messages import describe_cue
from rehab.sources.recording import Recording, RecordingError, read_recording
from rehab.sources.recording.sample_recordings import is_sample
from rehab.sources.synthetic import PROFILES, SyntheticWalker
from rehab.training.fold import SessionFold
from rehab.training.goals import GoalRule
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import Measurement, Side
from rehab.training.valences import VALENCES
from robot.simulation import SIMULATED_BASES, Simulation

BASELINE_STRIDES = 54
MIN_SYNTHETIC_STRIDES = 100


def finite_number(text: str) -> float:
    """Return a finite number from the command line. Raises ArgumentTypeError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ArgumentTypeError(f"{text!r} is not a finite number")
    return value


def parse_speed(text: str) -> float | None:
    """Return None for `max`, else a number above 0. Raises ArgumentTypeError."""
    if text == "max":
        return None
    value = finite_number(text)
    if value <= 0:
        raise ArgumentTypeError("give max, or a number above 0 (1 for true cadence)")
    return value


class Command(BaseCommand):
    """Runs a whole session, stores it like any other, and prints its figures."""

    help = "Score a recording or a simulated patient: a whole session without pages."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        source = parser.add_mutually_exclusive_group(required=True)
        source.add_argument("--recording", type=Path, metavar="FILE")
        source.add_argument("--synthetic", type=int, metavar="SEED")
        parser.add_argument("--valence", required=True, choices=sorted(VALENCES))
        parser.add_argument(
            "--goal",
            type=finite_number,
            help="goal value (default: the "
            "recording's own; 100 %% of baseline for a simulated patient)",
        )
        parser.add_argument(
            "--gain-from-recording",
            action="store_true",
            help="show what the recording showed (default: gain 1)",
        )
        parser.add_argument("--strides", type=int, default=1000, help="of a simulated patient")
        parser.add_argument("--profile", choices=sorted(PROFILES), default="good")
        parser.add_argument(
            "--speed",
            type=parse_speed,
            default=None,
            metavar="max|N",
            help="N times true cadence, or max (default)",
        )
        parser.add_argument(
            "--base",
            choices=sorted(SIMULATED_BASES),
            default="null",
            help="robot base that answers, on a clock that runs with the strides",
        )
        parser.add_argument(
            "--side",
            choices=[side.value for side in Side],
            help="trained leg (default: as recorded)",
        )
        parser.add_argument("--clinic", help="name of the clinic (default: the first one)")
        parser.add_argument("--patient", help="code of the patient (default: one for such runs)")
        parser.add_argument("--json", action="store_true", help="print JSON")

    def handle(self, *args: Any, **options: Any) -> None:
        """Run the session. Raises CommandError, with the cure, before anything is stored."""
        prepare_database()
        try:
            figures = self._run(options)
        except OwnedElsewhere as problem:
            raise CommandError(f"{problem} Or name another clinic: --clinic.") from problem
        except (InvalidSetting, RecordingError) as problem:
            raise CommandError(str(problem)) from problem
        self.stdout.write(json.dumps(figures, indent=2) if options["json"] else describe(figures))

    def _run(self, options: dict[str, Any]) -> dict[str, Any]:
        side = Side(options["side"]) if options["side"] else None
        recording = None
        if options["recording"]:
            recording = read_recording(options["recording"], trained_side=side)
            side = recording.trained_side
        side = side or Side.LEFT
        phases, goal = recorded_plan(recording, options) if recording else synthetic_plan(options)
        began = time.perf_counter()
        patient = find_patient(options, side)
        if (problem := find_elsewhere(patient.clinic_id)) is not None:
            raise problem
        session = create_session(
            SessionRequest(
                patient=patient,
                valence=options["valence"],
                goal=goal,
                phases=phases,
                trained_side=side,
                source=name_source(recording, options),
                simulated=recording is None or is_sample(options["recording"]),
            )
        )

        def strides(fold: SessionFold) -> Iterator[Measurement]:
            if recording is not None:
                return iter(recording)
            walker = SyntheticWalker(
                PROFILES[options["profile"]], options["synthetic"], side, options["valence"]
            )
            return simulate_strides(walker, fold, options["strides"])

        fold = asyncio.run(run_session(session.pk, strides, Pace(options["speed"])))
        wall_s = time.perf_counter() - began
        return session_report(
            session, fold, wall_s, recording, simulate_robot(session, fold, options["base"])
        )


def simulate_robot(session: TrainingSession, fold: SessionFold, base: str) -> dict[str, Any]:
    """Let a simulated robot answer a stored session; return what it did."""
    simulation = Simulation(base, describe_cue(fold))
    simulation.walk(robot_steps(session, fold))
    windows = len(simulation.decisions)
    return {
        "robot": {"base": base, "windows": windows, "activated_share": simulation.share},
        "gestures": simulation.gestures,
    }


def name_source(recording: Recording | None, options: dict[str, Any]) -> str:
    """Return the text that the session stores about its source."""
    if recording is not None:
        return f"recording {recording.name}"[:200]
    return f"simulated {options['profile']} {options['synthetic']}"


def recorded_plan(
    recording: Recording, options: dict[str, Any]
) -> tuple[tuple[Phase, ...], GoalRule]:
    """Return phases and goal of a recording. Raises InvalidSetting without any goal."""
    phases = recording.phases if options["gain_from_recording"] else recording.phases_at_gain_one()
    goal = options["goal"] if options["goal"] is not None else recording.goal
    if goal is None:
        raise InvalidSetting(
            "Recording {name} names no goal. Give one: --goal 2.55 (W/kg).", name=recording.name
        )
    return phases, GoalRule(value=goal)


def synthetic_plan(options: dict[str, Any]) -> tuple[tuple[Phase, ...], GoalRule]:
    """Return phases and goal of a simulated patient: a tenth of the strides is washout."""
    count = options["strides"]
    if count < MIN_SYNTHETIC_STRIDES:
        raise InvalidSetting("Give --strides {least} or more.", least=MIN_SYNTHETIC_STRIDES)
    washout = count // 10
    phases = (
        make_phase("baseline", strides=BASELINE_STRIDES),
        make_phase("training", strides=count - BASELINE_STRIDES - washout),
        make_phase("washout"),
    )
    goal = options["goal"]
    return phases, GoalRule(value=goal) if goal is not None else GoalRule(percent_of_baseline=100)


def find_patient(options: dict[str, Any], side: Side) -> Patient:
    """Return the session's patient; unless one is named, the command line's own."""
    clinic = first_clinic()
    if options["clinic"]:
        named = Clinic.everywhere.filter(name=options["clinic"]).first()
        if named is None:
            known = ", ".join(Clinic.everywhere.values_list("name", flat=True)[:10])
            raise CommandError(f"There is no clinic {options['clinic']!r}. Known: {known}.")
        clinic = named
    if options["patient"]:
        patient = Patient.everywhere.filter(clinic=clinic, code=options["patient"]).first()
        if patient is None:
            raise CommandError(
                f"{clinic} has no patient with the code {options['patient']!r}. "
                "Add the patient in the admin first."
            )
        return patient
    return Patient.everywhere.get_or_create(
        clinic=clinic,
        code="command-line",
        defaults={"nickname": "Command line", "paretic_side": side.value, "simulated": True},
    )[0]


def describe(figures: dict[str, Any]) -> str:
    """Return the figures as text."""
    rate = "–" if figures["hit_rate"] is None else f"{figures['hit_rate']:.1%}"
    lines = [
        f"Session {figures['session']}, {figures['valence']}: {figures['strides']} strides "
        f"({figures['valid']} valid, {figures['invalid']} invalid, {figures['missing']} missing, "
        f"{figures['late']} late)",
        f"Hits {figures['hits']} ({rate}), score "
        f"{'–' if figures['score'] is None else figures['score']}, "
        f"goal {figures['goal'] or math.nan:.3f}",
    ]
    for phase in figures["phases"]:
        mean = "–" if phase["mean"] is None else f"{phase['mean']:.3f}"
        share = "–" if phase["hit_rate"] is None else f"{phase['hit_rate']:.0%}"
        lines.append(
            f"  {phase['name']:<24} gain {phase['gain']:.2f}  {phase['strides']:>6} strides  "
            f"mean {mean}  hits {share}"
        )
    if "recorded_success" in figures:
        flags = figures["recorded_success"]
        lines.append(f"Agrees with the recording: {flags['agree']} of {flags['compared']}")
    lines.append(f"{figures['steps_per_s']} steps/s, {figures['wall_s']} s")
    return "\n".join(lines)

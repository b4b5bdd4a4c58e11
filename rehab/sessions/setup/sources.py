"""The sources of steps that the set-up offers."""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from pathlib import Path

from django.conf import settings

from rehab.people.models import Patient
from rehab.sessions.formatting import RECORDING_PREFIX, SIMULATED_PREFIX
from rehab.sessions.setup.recordings import recordings_folder
from rehab.sources.recording.sample_recordings import is_sample
from rehab.sources.recording.source import holds_signals
from rehab.sources.synthetic import PROFILES

LIVE = "live"
SIMULATED = "synthetic "  # begins the choice of a simulated patient


def list_recordings() -> list[Path]:
    """Return the recordings on this machine; none on a hosted server, where they have no clinic."""
    folder = recordings_folder()
    return [] if settings.HOSTED or not folder.is_dir() else sorted(folder.glob("*.csv"))


def source_choices() -> list[tuple[str, str]]:
    """Return the sources of steps as (choice, text that a session stores); see `format_source`."""
    simulated = [(f"{SIMULATED}{name}", f"{SIMULATED_PREFIX}{name}") for name in PROFILES]
    recordings = [
        (f"recording {file.name}", f"{RECORDING_PREFIX}{file.name}") for file in list_recordings()
    ]
    return [(LIVE, "Live sensor"), *simulated, *recordings]


def build_source_args(kind: str, name: str, patient: Patient) -> list[str]:
    """Return the arguments of `python -m rehab.sources` for a choice of `source_choices`.

    ``kind`` and ``name`` are its two words. Returns [] for a source that dials in by itself.
    """
    match kind:
        case "synthetic":
            return ["synthetic", "--profile", name, "--seed", str(secrets.randbelow(2**31))]
        case "recording":
            file = recordings_folder() / name
            mass = ["--mass", str(patient.body_mass_kg)] if holds_signals(file) else []
            return ["recording", str(file), *mass]
    return []


def is_simulated(patient: Patient, source_args: Sequence[str]) -> bool:
    """Return whether nobody walks: a simulated patient, or what GARRY made itself."""
    match source_args:
        case ["synthetic", *_]:
            return True
        case ["recording", file, *_]:
            return patient.simulated or is_sample(Path(file))
    return patient.simulated

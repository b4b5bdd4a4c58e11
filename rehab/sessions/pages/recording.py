"""The page on which recorded signals are checked, before anybody walks with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.utils.formats import number_format
from django.utils.translation import gettext as _
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import for_roles, user_of
from rehab.people.models import SIDES as LEGS
from rehab.people.roles import Role
from rehab.sessions.setup.recordings import (
    CHANNELS,
    MASS_MAX_KG,
    MASS_MIN_KG,
    PART_BYTES,
    SIDES,
    UPLOAD_BYTES_MAX,
    Checked,
    UploadRefused,
    add_part,
    check_upload,
    find_endings,
    name_recording,
    recordings_folder,
    uploaded_file,
    write_columns,
)


@for_roles(Role.LEAD, Role.PT, patients=False)
@require_POST
def add_recording_part(request: HttpRequest) -> HttpResponse:
    """Take a part of a file; ``at`` is where it belongs, ``ending`` what kind of file it is."""
    at = request.GET.get("at", "")
    try:
        place = request.GET.get("file", "0")
        if not place.isdecimal() or len(place) > 1:
            raise UploadRefused
        file = uploaded_file(user_of(request).pk, request.GET.get("ending", "").lower(), int(place))
        if not at.isdecimal() or len(at) > len(str(UPLOAD_BYTES_MAX)):
            raise UploadRefused
        add_part(file, request.body, int(at))
    except UploadRefused:
        return JsonResponse({"message": _refusal()}, status=400)
    return JsonResponse({"next": int(at) + len(request.body)})


@for_roles(Role.LEAD, Role.PT, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def check_recording(request: HttpRequest) -> HttpResponse:
    """Show what an upload's columns are taken for; store it once a person has confirmed them."""
    asked = request.POST
    context: dict[str, Any] = {
        "endings": ",".join(find_endings()),
        "bytes_max": UPLOAD_BYTES_MAX,
        "mib_max": UPLOAD_BYTES_MAX // 2**20,
        "part_bytes": PART_BYTES,
        "mass": asked.get("mass", ""),
        "name": asked.get("name", "")[:60],
        "files": asked.get("files", "")[:1000],
        "is_hosted": settings.HOSTED,
    }
    if request.method == "POST":
        files = _find_upload(request)
        mass_kg = _read_mass(context["mass"])
        if not files:
            context["problems"] = [_refusal()]
        elif context["mass"].strip() and mass_kg is None:
            context["problems"] = [
                _("Enter the body mass in kg, %(least)d to %(most)d.")
                % {"least": MASS_MIN_KG, "most": MASS_MAX_KG}
            ]
        else:
            context |= {"ending": ",".join(file.suffix for file in files)}
            context |= _answer(request, files, mass_kg)
            context["problems"] = _name_files(context["problems"], files, context["files"])
    return render(request, "sessions/recording.html", context)


def _answer(request: HttpRequest, files: list[Path], mass_kg: float | None) -> dict[str, Any]:
    """Return what the page shows of a check, or of a recording that was confirmed."""
    asked = request.POST
    if "confirm" not in asked:
        checked = check_upload(files, mass_kg)
        return _describe(checked, _proposed(checked))
    chosen = {
        f"{side}.{channel}": {
            part: asked.get(f"{side}.{channel}.{part}", "")[:200]
            for part in ("column", "factor", "delay_ms")
        }
        for side in SIDES
        for channel in CHANNELS
    }
    time = {part: asked.get(f"time.{part}", "")[:200] for part in ("column", "factor")}
    is_overground = "overground" in asked
    try:
        columns = write_columns(chosen, time)
    except ValueError as problem:
        problems = [_("%(text)s is not a number.") % {"text": problem}]
        checked = check_upload(files, mass_kg, is_overground=is_overground)
        return _describe(checked, chosen) | {"problems": problems}
    name = name_recording(asked.get("name", ""))
    if not settings.HOSTED and not name:
        problems = [_("Give the recording a name.")]
        checked = check_upload(files, mass_kg, is_overground=is_overground)
        return _describe(checked, chosen) | {"problems": problems}
    save = None if settings.HOSTED else recordings_folder() / name
    checked = check_upload(files, mass_kg, columns, save, is_overground=is_overground)
    shown = _describe(checked, chosen)
    if not shown["problems"]:
        for file in files:
            file.unlink(missing_ok=True)
        command = ["--overground"] if is_overground else []
        is_ours = any("=plates." in one or "=own." in one for one in columns)
        command += ["--check"] if is_ours else ["--columns", *map(_quote, columns)]
        shown |= {"stored": name, "found": None, "command": " ".join(command), "is_ours": is_ours}
    return shown


def _name_files(problems: list[str], files: list[Path], names: str) -> list[str]:
    """Return problems with the names that a person's files have; ``names`` stand between "/"."""
    own = dict(zip((file.name for file in files), names.split("/"), strict=False))
    for stored, name in own.items():
        problems = [text.replace(stored, name or stored) for text in problems]
    return problems


def _describe(checked: Checked, chosen: dict[str, dict[str, str]]) -> dict[str, Any]:
    found = checked.found
    guesses = {f"{c['side']}.{c['channel']}": c for c in found["channels"]} if found else {}
    words = {"force": _("Vertical force"), "moment": _("Ankle moment"), "angle": _("Ankle angle")}
    legs = dict(LEGS)
    channels = [
        {
            "key": f"{side}.{channel}",
            "label": f"{legs[side]}: {words[channel]}",
            "guess": guesses.get(f"{side}.{channel}"),
            "chosen": chosen.get(f"{side}.{channel}", {}),
        }
        for side in SIDES
        for channel in CHANNELS
    ]
    problems = checked.wrong
    if found is None and not problems:
        problems = [_("This file cannot be read. Export half a minute of walking again.")]
    walked = (
        {}
        if found is None
        else {
            "rate": round(found["rate_hz"]),
            "kg": found["mass_kg"],
            "a2": [
                f"{legs[side]}: A2 {number_format(a2_w_kg, 2)} W/kg"
                for side, a2_w_kg in found["a2_w_kg"].items()
            ],
            **{name: found[name] for name in ("strides", "valid", "late", "lost")},
        }
    )
    return {"found": found, "channels": channels, "problems": problems, **walked}


def _proposed(checked: Checked) -> dict[str, dict[str, str]]:
    """Return what the check found as a person would write it; a delay has to be measured."""
    return {
        f"{one['side']}.{one['channel']}": {
            "column": one["column"],
            "factor": f"{one['factor']:.9g}",
            "delay_ms": "",
        }
        for one in (checked.found or {"channels": []})["channels"]
    }


def _find_upload(request: HttpRequest) -> list[Path]:
    """Return the files of an upload, by their endings; none where one did not arrive."""
    endings = request.POST.get("ending", "").split(",")
    try:
        files = [uploaded_file(user_of(request).pk, one, n) for n, one in enumerate(endings)]
    except UploadRefused:
        return []
    return files if all(file.exists() for file in files) else []


def _read_mass(text: str) -> float | None:
    try:
        mass_kg = float(text.replace(",", "."))
    except ValueError:
        return None
    return mass_kg if MASS_MIN_KG <= mass_kg <= MASS_MAX_KG else None


def _quote(pair: str) -> str:
    return f"'{pair}'"


def _refusal() -> str:
    return _("Choose a file of %(kinds)s with at most %(most)d MiB.") % {
        "kinds": ", ".join(find_endings()),
        "most": UPLOAD_BYTES_MAX // 2**20,
    }

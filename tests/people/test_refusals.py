"""What rules refuse is said in the language of the page, and in English to programs and logs."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from string import Formatter

import polib
import pytest
from django.test import Client
from django.urls import reverse
from django.utils.translation import override

from rehab.people.models import Clinic
from rehab.people.roles import Role
from rehab.people.web.refusals import format_refusal
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.training.changes import ChangeKind, NotAllowed, State
from rehab.training.controls import CONTROLS
from rehab.training.goals import GoalRule
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import Phase
from rehab.training.valences import VALENCES, CueGestures, edit_valence
from robot.motion.composed_gestures import Move, build_gesture
from robot.motion.gesture_errors import BadGesture
from tests.support.forms import feedback_form, gesture_form, session_form
from tests.support.programs import program_of
from tests.support.world import World

CATALOG = Path(__file__).parents[2] / "locale/es/LC_MESSAGES/django.po"
ENGLISH = re.compile(
    r"\b(the|a|an|of|and|or|is|be|must|needs|give|cannot|from|to)\b", re.IGNORECASE
)


def said(act: Callable[[], object], language: str = "es") -> str:
    with override(language):
        try:
            act()
        except (InvalidSetting, BadGesture) as problem:
            return format_refusal(problem)
    raise AssertionError("nothing was refused")


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (
            lambda: A2.check_goal(16.5),
            "No se puede usar un objetivo de 16,5 W/kg para potencia de propulsión del tobillo A2.",
        ),
        (lambda: Phase("training", "Bloque", True, strides=0), "La fase 'Bloque' necesita"),
        (GoalRule, "Dé el objetivo como valor o como porcentaje"),
        (
            lambda: CONTROLS[ChangeKind.FINISH].next_state(State.READY),
            "Una sesión lista no admite el cambio «fin»; debe estar en pausa o en marcha.",
        ),
        (
            lambda: edit_valence(
                "negative",
                hit_points=1,
                miss_points=0,
                bands=VALENCES["negative"].bands,
                cue=CueGestures(),
            ),
            "Negativa: esta retroalimentación no da nada por un acierto y quita puntos",
        ),
        (
            lambda: build_gesture("wave", [Move(turn_rad=0.5)]),
            "Termina con un giro de 29° a la izquierda. Añada pasos que vuelvan al origen.",
        ),
        (
            lambda: build_gesture("wave", [Move(forward_m=0.4)]),
            "Paso 1: se aleja 0,40 m del origen",
        ),
    ],
)
def test_a_refusal_is_said_in_spanish_with_its_values(act, words):
    assert words in said(act)
    assert not ENGLISH.search(re.sub("a2|'.*?'| a ", "", said(act))), said(act)


def test_the_message_itself_stays_english():
    with override("es"), pytest.raises(NotAllowed) as refused:
        CONTROLS[ChangeKind.FINISH].next_state(State.READY)
    assert str(refused.value) == (
        "A session that is ready cannot take the change 'finish'; it must be paused or running."
    )
    assert said(lambda: A2.check_goal(16.5), "en").startswith("A goal of 16.5 W/kg cannot be used")


def test_what_is_no_template_is_said_as_it_is():
    assert format_refusal(InvalidSetting("Rosa {K-7} ended.")) == "Rosa {K-7} ended."


def test_every_translated_refusal_takes_the_values_of_its_source():
    refusals = [e for e in polib.pofile(str(CATALOG)) if e.comment == "refusal"]
    assert len(refusals) > 60
    for entry in refusals:
        places = {name for _, name, _, _ in Formatter().parse(entry.msgid) if name}
        for text in (entry.msgid, entry.msgstr):
            assert text.format(**dict.fromkeys(places, 1.5)), entry


# --- forms ----------------------------------------------------------------------------------------


@pytest.fixture
def world(world: World) -> World:
    Clinic.everywhere.filter(pk=world.clinic.pk).update(language="es")
    return world


def complaints(client: Client, url: str, data: Mapping[str, object]) -> str:
    """Send a form that is refused; return what its page complains of."""
    answer = client.post(url, data)
    assert answer.status_code == 200
    lists = re.findall(
        r'class="(?:errorlist|wrong)[^>]*>(.*?)</(?:ul|p|div)>',
        html.unescape(answer.content.decode()),
        re.DOTALL,
    )
    found = " ".join(re.sub("<[^>]*>", " ", one) for one in lists).strip()
    assert found
    assert not ENGLISH.search(re.sub(r"'.*?'| a ", " ", found)), found
    return found


def test_a_protocol_is_refused_in_spanish(world):
    phases = {"kind": "training", "name": "Bloque", "feedback": "on", "gain": "9", "position": "1"}
    data = {f"phases-0-{name}": value for name, value in phases.items()}
    data |= {"name": "Uno", "phases-TOTAL_FORMS": "1", "phases-INITIAL_FORMS": "0"}
    found = complaints(world.pt, reverse("admin:rehab_protocol_add"), data)
    assert "Dé de 50 a 150 %." in found


def test_a_preset_is_refused_in_spanish(world):
    data = {
        "name": "x",
        "valence": "positive",
        "measure": world.rows[MeasureDefinition].pk,
        "goal_by": "value",
        "robot": "normal",
        "robot_above": "(usual)",
        "robot_below": "(usual)",
        "source": "",
        "protocol": world.rows[Protocol].pk,
    }
    found = complaints(world.pt, reverse("admin:rehab_preset_add"), data)
    assert "Dé el objetivo como valor o como porcentaje de la línea base." in found


def test_a_feedback_type_is_refused_in_spanish(world):
    url = f"{reverse('admin:rehab_feedbacktype_add')}?slug=positive"
    data = feedback_form("positive", hit_points="0")
    found = complaints(world.lead, url, data)
    assert "Positiva: esta retroalimentación da puntos por un acierto y no quita nada" in found
    data = feedback_form("positive", **{"bands-2-from_percent": "99"})
    found = complaints(world.lead, url, data)
    assert "Positiva: una franja debe empezar en 1, el objetivo." in found


def test_a_gesture_is_refused_in_spanish(world):
    url = reverse("admin:rehab_composedgesture_add")
    found = complaints(world.pt, url, gesture_form("ola", [{"turn_deg": 30}]))
    assert "Termina con un giro de 30° a la izquierda." in found
    found = complaints(world.pt, url, gesture_form("nod", [{"hold_s": 1}]))
    assert "Todos los robots conocen ya nod." in found


def test_a_set_up_is_refused_in_spanish_and_to_a_program_in_english(world):
    rosa, station = world.add_patient(), world.add_station("Ventana")
    percent = session_form(station) | {"goal_by": "percent", "goal_percent": "100"}
    page = world.pt.post(f"/patients/{rosa.pk}/new/", percent)
    told = str(page.context["form"].errors)
    assert "necesita una fase de línea base antes de la primera retroalimentación" in told
    asked = {"patient": rosa.pk, "station": station.pk, "goal_percent": 100}
    training = Protocol.everywhere.get(name="Training only", clinic=None)
    status, answer = program_of(world, Role.PT).post("/sessions", protocol=training.pk, **asked)
    assert status == 409
    assert "needs a baseline phase before the first feedback" in str(answer)

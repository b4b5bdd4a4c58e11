"""Standard tests of walking and balance: what each measures, how it is done, what is usual.

One definition for the clinic's pages, exports and studies. Wordings are GARRY's own; where norms
and least changes are from: docs/reference/questionnaires.md#walking-tests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from math import isfinite
from typing import Any

from rehab.questionnaires.form_items import FormItem
from rehab.training.measures import InvalidSetting
from robot.marking import gettext_noop

LAP_TEST_S = 360.0  # six minutes


class Way(StrEnum):
    """How it is taken: by a stopwatch, a timed distance, laps, as a score, or as a form's sum."""

    STOPWATCH = "stopwatch"
    SPEED = "speed"
    LAPS = "laps"
    SCORE = "score"
    FORM = "form"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClinicalTest:
    """A standard test, or one of a clinic's own.

    Attributes
    ----------
    slug, label, unit, places
        For programs and for people; of its result ("" for points), with so many decimals.
    least, most
        Results that can be.
    higher_is_better
        Whether a higher result is the better one.
    way
        How it is taken.
    steps
        What to do, a sentence each.
    norms
        From an age [years] on, from where to where healthy people are average; the lower end is
        `least` where a source names a limit alone.
    least_change
        From which change on it is more than chance, or matters to patients; None: unknown.
    levels
        The words of each score, from 0; empty where a score is a sum.
    items
        Of a form: what is asked.
    loinc
        Its code; "" where LOINC has none that fits.
    """

    slug: str
    label: str
    unit: str
    places: int
    least: float
    most: float
    higher_is_better: bool
    way: Way
    steps: Sequence[str]
    norms: Sequence[tuple[int, float, float]] = ()
    least_change: float | None = None
    levels: Sequence[str] = ()
    items: Sequence[FormItem] = ()
    loinc: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data; `from_json` reads it."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> ClinicalTest:
        """Return what `to_json` wrote."""
        items = [FormItem(**item) for item in data["items"]]
        return cls(**{**data, "way": Way(data["way"]), "items": items})

    def check(self, value: float) -> None:
        """Raise InvalidSetting for a result that this test does not have."""
        whole = self.way is not Way.SCORE or (isfinite(value) and value == int(value))
        if not (whole and self.least <= value <= self.most):
            raise InvalidSetting(
                "Results of this test lie between {least:g} and {most:g} {unit}. Check what was "
                "measured.",
                least=self.least,
                most=self.most,
                unit=self.unit,
            )

    def find_norm(self, age: int | None) -> tuple[float, float] | None:
        """Return the usual range at an age [years]; None where none is known."""
        if age is None:
            return None
        fitting = [(low, high) for start, low, high in self.norms if start <= age]
        return fitting[-1] if fitting else None

    def judge(self, before: float, now: float) -> int:
        """Return 1 for a change that counts to the better, -1 to the worse, 0 for none."""
        change = now - before if self.higher_is_better else before - now
        enough = 0.0 if self.least_change is None else self.least_change
        # Results are rounded: 0.16 m/s, measured as 0.78 and 0.94, are a change of 0.16.
        if abs(change) < enough - 10 ** -(self.places + 3) or change == 0:
            return 0
        return 1 if change > 0 else -1


WALK_SPEED = (
    gettext_noop("Mark ten meters, and two more before and behind them."),
    gettext_noop("Start the time when the first foot crosses the first mark."),
    gettext_noop("Stop it when the first foot crosses the last mark."),
    gettext_noop("Walking aid and orthosis as usual; walk slightly behind, never ahead."),
)
STOP_AT_ONCE = gettext_noop(  # ATS 2002
    "Stop at once for chest pain, severe breathlessness, leg cramps, dizziness or "
    "staggering, heavy sweating, or a pale face."
)
# What a standard test is about, and about how many minutes it takes, for who plans a visit.
PURPOSES = {
    "10mwt": (gettext_noop("Comfortable walking speed"), 5),
    "10mwt_fast": (gettext_noop("How fast the patient can walk"), 5),
    "6mwt": (gettext_noop("Endurance: how far in six minutes"), 10),
    "tug": (gettext_noop("Stand up, walk, turn, sit: risk of falls"), 3),
    "5sts": (gettext_noop("Leg strength"), 3),
    "fac": (gettext_noop("How much help walking takes"), 5),
    "fma_le": (gettext_noop("Movement and reflexes of the leg"), 15),
    "berg": (gettext_noop("Balance, sitting and standing"), 20),
}
# Each number's source is beside it; in full in docs/reference/questionnaires.md#walking-tests.
CLINICAL_TESTS: dict[str, ClinicalTest] = {
    test.slug: test
    for test in (
        ClinicalTest(
            slug="10mwt",
            label=gettext_noop("10-meter walk, comfortable"),
            unit="m/s",
            places=2,
            least=0.01,
            most=4.0,
            higher_is_better=True,
            way=Way.SPEED,
            steps=(*WALK_SPEED, gettext_noop("Say: “Walk at your own comfortable speed.”")),
            norms=(  # means of women and men: Bohannon & Williams Andrews 2011
                (20, 1.34, 1.36),
                (30, 1.34, 1.43),
                (40, 1.39, 1.43),
                (50, 1.31, 1.43),
                (60, 1.24, 1.34),
                (70, 1.13, 1.26),
                (80, 0.94, 0.97),
            ),
            least_change=0.16,  # Tilson 2010
        ),
        ClinicalTest(
            slug="10mwt_fast",
            label=gettext_noop("10-meter walk, fast"),
            unit="m/s",
            places=2,
            least=0.01,
            most=6.0,
            higher_is_better=True,
            way=Way.SPEED,
            steps=(*WALK_SPEED, gettext_noop("Say: “Walk as fast as you safely can.”")),
            least_change=0.1,  # Hiengkaew 2012
        ),
        ClinicalTest(
            slug="6mwt",
            label=gettext_noop("6-minute walk"),
            unit="m",
            places=0,
            least=0,
            most=1200,
            higher_is_better=True,
            way=Way.LAPS,
            steps=(
                gettext_noop(
                    "A straight walkway, 30 meters if there is one, with a cone at each end."
                ),
                gettext_noop(
                    "The patient walks as far as possible and may rest; the time runs on."
                ),
                gettext_noop("Tap “Lap” at each turn. Every minute, say how much time is left."),
                gettext_noop("At six minutes, measure the meters since the last turn."),
                STOP_AT_ONCE,
            ),
            norms=((60, 538, 572), (70, 471, 527), (80, 392, 417)),  # means: Steffen 2002
            least_change=34.4,  # Tang 2012
            loinc="64098-7",
        ),
        ClinicalTest(
            slug="tug",
            label=gettext_noop("Timed Up and Go"),
            unit="s",
            places=1,
            least=2,
            most=600,
            higher_is_better=False,
            way=Way.STOPWATCH,
            steps=(
                gettext_noop("A chair with arms, about 46 cm high; a mark three meters ahead."),
                gettext_noop(
                    "Start at “go”: stand up, walk to the mark, turn, walk back, sit down."
                ),
                gettext_noop(
                    "Stop when the back touches the chair. A practice trial before it does not "
                    "count."
                ),
            ),
            # 95 % confidence intervals of means: Bohannon 2006
            norms=((60, 7.1, 9.0), (70, 8.2, 10.2), (80, 10.0, 12.7)),
            least_change=2.9,  # Flansbjer 2005
            loinc="89423-8",
        ),
        ClinicalTest(
            slug="5sts",
            label=gettext_noop("Five times sit to stand"),
            unit="s",
            places=1,
            least=2,
            most=300,
            higher_is_better=False,
            way=Way.STOPWATCH,
            steps=(
                gettext_noop("A chair about 43 cm high, its back against the wall; arms crossed."),
                gettext_noop(
                    "Start at “go”: stand up fully and sit down, five times, as fast as is safe."
                ),
                gettext_noop("Stop when the fifth stand is complete."),
            ),
            norms=((60, 2, 11.4), (70, 2, 12.6), (80, 2, 14.8)),  # at most: Bohannon 2006
            least_change=3.0,  # of who walks outside a little: Martín-San Agustín 2021
        ),
        ClinicalTest(
            slug="fac",
            label=gettext_noop("Functional ambulation (FAC)"),
            unit="",
            places=0,
            least=0,
            most=5,
            higher_is_better=True,
            way=Way.SCORE,
            steps=(
                gettext_noop(
                    "How much help from a person the patient needs to walk; walking aids are "
                    "allowed."
                ),
            ),
            least_change=1,  # a category
            levels=(
                gettext_noop("Cannot walk, or needs two people"),
                gettext_noop("Needs one person all the time, to carry weight"),
                gettext_noop("Needs one person’s touch now and then, for balance"),
                gettext_noop("Needs someone beside them, without touch"),
                gettext_noop("Walks alone on level ground"),
                gettext_noop("Walks alone everywhere, including stairs"),
            ),
        ),
        ClinicalTest(
            slug="fma_le",
            label="Fugl-Meyer, lower extremity",
            unit="",
            places=0,
            least=0,
            most=34,
            higher_is_better=True,
            way=Way.SCORE,
            steps=(gettext_noop("Use the clinic’s own form, and enter its total."),),
            least_change=6,  # Pandian 2016
        ),
        ClinicalTest(
            slug="berg",
            label="Berg Balance Scale",
            unit="",
            places=0,
            least=0,
            most=56,
            higher_is_better=True,
            way=Way.SCORE,
            steps=(gettext_noop("Use the clinic’s own form, and enter its total."),),
            norms=((60, 55, 55), (70, 53, 54), (80, 50, 53)),  # means: Steffen 2002
            least_change=5,  # Hiengkaew 2012
        ),
    )
}


def to_speed(meters: float, seconds: float) -> float:
    """Return a speed [m/s]. Raises InvalidSetting for times and distances that are none."""
    if not (isfinite(meters) and isfinite(seconds) and meters > 0 and seconds > 0):
        raise InvalidSetting("Give the distance in meters and the time in seconds.")
    return meters / seconds

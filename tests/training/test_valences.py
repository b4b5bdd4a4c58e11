"""Every valence: what it may say, show and pay."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re

import pytest

from rehab.training.feedback_bands import Band, Confetti, bands_from_json, bands_to_json
from rehab.training.measures import InvalidSetting
from rehab.training.phrases import NOTHING_LOST
from rehab.training.valences import (
    POINTS_MAX,
    POSITIVE,
    VALENCES,
    CueGestures,
    Emblem,
    Valence,
    edit_valence,
    find_valence,
)

PRAISE = {"good", "great", "well", "strong", "nice", "perfect", "super", "reached", "won", "what"}
BLAME = {
    "bad",
    "wrong",
    "poor",
    "weak",
    "fail",
    "failed",
    "miss",
    "missed",
    "lost",
    "lose",
    "below",
}
HITS = (1.0, 1.05, 1.1, 1.2, 1.25, 2.0, 1000.0)
MISSES = (-1000.0, 0.0, 0.5, 0.75, 0.9, math.nextafter(1, 0))


@pytest.fixture(params=list(VALENCES))
def valence(request: pytest.FixtureRequest) -> Valence:
    return VALENCES[request.param]


def words_of(text: str) -> list[str]:
    return re.findall(r"\w+", text.lower())


def test_it_is_found_by_its_name(valence: Valence) -> None:
    assert find_valence(valence.slug) is VALENCES[valence.slug] is valence
    assert valence.label
    assert valence.hue


def test_words_are_few_and_whole(valence: Valence) -> None:
    for band in valence.bands:
        assert len(set(band.phrases)) >= (12 if valence.has_points else 0)
        for phrase in band.phrases:
            assert 1 <= len(words_of(phrase)) <= 6
            assert not re.search("n['’]t|['’](ll|re|ve)", phrase), "no contractions"


def test_no_two_bands_side_by_side_say_the_same(valence: Valence) -> None:
    assert all(low.words != high.words for low, high in itertools.pairwise(valence.bands))


def test_a_hit_never_costs_and_a_miss_never_pays(valence: Valence) -> None:
    assert (valence.points(True) or 0) >= 0 >= (valence.points(False) or 0)


def test_the_emblem_follows_the_points(valence: Valence) -> None:
    emblem = {1: Emblem.GAIN, 0: Emblem.NEUTRAL, None: Emblem.NEUTRAL, -1: Emblem.LOSS}
    for hit in (True, False):
        assert valence.emblem(hit) is emblem[valence.points(hit)]


def test_confetti_falls_only_where_points_are_won(valence: Valence) -> None:
    for performance in (*HITS, *MISSES):
        if valence.band(performance).confetti is not Confetti.NONE:
            assert performance >= 1
            assert (valence.points(True) or 0) > 0


def test_a_gesture_follows_what_is_paid(valence: Valence) -> None:
    assert (valence.cue.above is not None) == ((valence.points(True) or 0) > 0)
    assert (valence.cue.below is not None) == ((valence.points(False) or 0) < 0)


def test_what_wins_nothing_is_not_praised_and_what_costs_nothing_is_not_blamed(
    valence: Valence,
) -> None:
    for performances, hit in ((HITS, True), (MISSES, False)):
        points = valence.points(hit) or 0
        for performance in performances:
            for words in valence.band(performance).phrases:
                if points <= 0:
                    assert not PRAISE & set(words_of(words))
                    assert "!" not in words
                if points >= 0 and words not in NOTHING_LOST.splitlines():
                    assert not BLAME & set(words_of(words))


@pytest.mark.parametrize("performance", [*HITS, *MISSES])
def test_explicit_says_the_same_of_every_step(performance: float) -> None:
    explicit = VALENCES["explicit"]
    assert not explicit.has_points
    assert explicit.band(performance) is explicit.bands[0]
    assert explicit.bands[0].words == ""  # its page says the goal beside the value
    assert explicit.emblem(performance >= 1) is Emblem.NEUTRAL


@pytest.mark.parametrize(
    ("performance", "index"),
    [
        (-5.0, 0),
        (0.0, 0),
        (math.nextafter(0.75, 0), 0),
        (0.75, 1),
        (math.nextafter(1, 0), 1),
        (1.0, 2),
        (math.nextafter(1.1, 0), 2),
        (1.1, 3),
        (1.25, 4),
        (1000.0, 4),
    ],
)
def test_a_band_holds_from_its_performance_upwards(performance: float, index: int) -> None:
    assert POSITIVE.band(performance) is POSITIVE.bands[index]


def bands(*starts: float) -> tuple[Band, ...]:
    return tuple(Band(start, "Words.") for start in starts)


@pytest.mark.parametrize(
    ("broken", "cure"),
    [
        ({"hit_points": None}, "or for neither"),
        ({"miss_points": None}, "or for neither"),
        ({"hit_points": -1}, "a hit pays 0 to 1000"),
        ({"hit_points": 1001}, "a hit pays 0 to 1000"),
        ({"miss_points": 1}, "a miss costs 0 to 1000"),
        ({"miss_points": -1001}, "a miss costs 0 to 1000"),
        ({"bands": ()}, "first band begins at 0"),
        ({"bands": bands(0.5, 1)}, "first band begins at 0"),
        ({"bands": bands(0, 1, 1)}, "each next one higher"),
        ({"bands": bands(0, 1.1, 1)}, "each next one higher"),
        ({"bands": bands(0, 1, math.inf)}, "each next one higher"),
        ({"bands": bands(0, math.nan, 1)}, "each next one higher"),
        ({"bands": bands(0, 0.9)}, "must begin at 1"),
    ],
)
def test_broken_data_is_refused_with_the_cure(broken: dict[str, object], cure: str) -> None:
    with pytest.raises(InvalidSetting, match=f"Positive: .*{cure}"):
        dataclasses.replace(POSITIVE, **broken)  # type: ignore[arg-type]


def test_a_pt_may_word_a_valence_anew() -> None:
    own = Valence("own", "Own", "blue", 5, -2, bands(0, 1), CueGestures(above="bow"))
    assert (own.points(True), own.points(False)) == (5, -2)


def test_an_unknown_valence_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InvalidSetting, match=r"'happy'.*positive, negative, binary, explicit"):
        find_valence("happy")


def edited(slug: str, **changes: object) -> Valence:
    usual = VALENCES[slug]
    parts = {
        name: getattr(usual, name) for name in ("hit_points", "miss_points", "bands", "cue")
    } | changes
    return edit_valence(slug, **parts)


def test_a_clinic_words_and_pays_a_valence_in_its_own_way() -> None:
    bands = (Band(0, "Go on."), Band(1, "There!", Confetti.MOST))
    mine = edited("positive", hit_points=5, bands=bands, cue=CueGestures(above="nod"))
    assert (mine.label, mine.hue) == (VALENCES["positive"].label, VALENCES["positive"].hue)
    assert (mine.points(True), mine.points(False), mine.band(1.3).words) == (5, 0, "There!")


@pytest.mark.parametrize(
    ("slug", "changes", "why"),
    [
        ("positive", {"miss_points": -1}, "pays for a hit and takes nothing for a miss"),
        ("positive", {"hit_points": 0}, "pays for a hit"),
        ("negative", {"hit_points": 1}, "pays nothing for a hit and takes for a miss"),
        ("negative", {"miss_points": 0}, "takes for a miss"),
        ("binary", {"miss_points": 0}, "pays for a hit and takes for a miss"),
        ("binary", {"hit_points": None, "miss_points": None}, "pays for a hit"),
        ("explicit", {"hit_points": 1, "miss_points": 0}, "has no points"),
        ("explicit", {"cue": CueGestures(above="celebrate")}, "stands still"),
        ("positive", {"hit_points": POINTS_MAX + 1}, f"0 to {POINTS_MAX} points"),
        ("positive", {"bands": (Band(0, "x" * 61), Band(1, "y"))}, "at most 60 characters"),
        ("positive", {"bands": (Band(0, "a"),)}, "begin at 1, the goal"),
        ("explicit", {"bands": tuple(Band(n, "a") for n in range(13))}, "at most 12 bands"),
    ],
)
def test_no_edit_makes_another_rule_set_of_a_valence(
    slug: str, changes: dict[str, object], why: str
) -> None:
    with pytest.raises(InvalidSetting, match=why):
        edited(slug, **changes)


@pytest.mark.parametrize("slug", VALENCES)
def test_bands_survive_being_stored(slug: str) -> None:
    bands = VALENCES[slug].bands
    assert bands_from_json(json.loads(json.dumps(bands_to_json(bands)))) == bands


@pytest.mark.parametrize("data", [None, 1, ["x"], [{}], [{"from_performance": "0", "words": ""}]])
def test_what_are_no_bands_is_refused(data: object) -> None:
    with pytest.raises(InvalidSetting, match="from_performance"):
        bands_from_json(data)

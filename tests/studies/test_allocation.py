"""Allocation: balanced, concealed, and the same again from the seed."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from itertools import pairwise, product

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rehab.studies.allocation import blocks, lists, minimization
from rehab.studies.allocation.crossover import VisitPlan, crossover_groups, williams_orders
from rehab.studies.allocation.draws import RULE, Draws
from rehab.studies.allocation.groups_and_strata import Allocated, Factor, Group
from rehab.studies.allocation.scheme import Method, Scheme, Secret
from rehab.studies.arms import ArmRule, Condition, check_arms, check_channels
from rehab.training.measures import InvalidSetting
from rehab.training.phases import make_phase

SEEDS = st.text("abcdef0123456789", min_size=8, max_size=32)
SEVERITY = Factor("severity", ("mild", "severe"))
SIDE = Factor("side", ("left", "right"))


def make_groups(*weights: int) -> tuple[Group, ...]:
    return tuple(Group((code,), weight) for code, weight in zip("ABCDEFGH", weights, strict=False))


GROUPS = st.lists(st.integers(1, 3), min_size=2, max_size=4).map(lambda w: make_groups(*w))


def allocate_all(
    scheme: Scheme, secret: Secret, people: Sequence[tuple[str, ...]]
) -> list[Allocated]:
    earlier: list[Allocated] = []
    for levels in people:
        earlier.append(Allocated(levels, scheme.allocate(secret, earlier, levels)))
    return earlier


# --- draws ----------------------------------------------------------------------------------------


def test_draws_are_those_of_the_written_rule():
    """Computed apart from the code, as anybody would who checks a study."""
    from hashlib import sha256

    word = int.from_bytes(sha256(b"8:seedseed|6:blocks|0").digest()[:8], "big")
    assert Draws("seedseed", "blocks").below(1000) == word % 1000
    examples = re.findall(r'"(8:seedseed[^"]*)" (?:gives )?([0-9a-f]{16})', " ".join(RULE.split()))
    assert len(examples) == 3
    for hashed, first in examples:
        assert sha256(hashed.encode()).hexdigest()[:16] == first
    local = Draws(
        "seedseed", "blocks", "m\u00e4\u00dfig"
    )  # lengths are of characters, not of bytes
    assert local.below(1 << 60) == int(examples[2][1], 16) % (1 << 60)


@given(SEEDS, st.lists(st.integers(), max_size=20))
def test_a_shuffle_keeps_what_it_shuffles(seed, items):
    assert sorted(Draws(seed).shuffle(items)) == sorted(items)


def test_every_order_is_drawn_about_equally_often():
    draws = Draws("fair and square")
    seen = Counter(tuple(draws.shuffle("abc")) for _ in range(6000))
    assert len(seen) == 6
    assert all(880 < count < 1120 for count in seen.values())  # 1000 ± 4 standard errors of 29


def test_contexts_that_read_alike_draw_apart():
    assert Draws("seed", "ab", "c").below(1 << 60) != Draws("seed", "a", "bc").below(1 << 60)


# --- blocks ---------------------------------------------------------------------------------------


@given(GROUPS, st.sets(st.integers(1, 3), min_size=1), SEEDS)
def test_every_block_holds_the_groups_in_their_ratio(groups, multiples, seed):
    unit = sum(group.weight for group in groups)
    sizes = [unit * multiple for multiple in sorted(multiples)]
    blocks.check_block_sizes(groups, sizes)
    draws = Draws(seed, "blocks")
    for _ in range(6):
        block = blocks.block_of(groups, sizes, draws)
        assert len(block) in sizes
        assert Counter(block) == {g.name: g.weight * len(block) // unit for g in groups}


@given(
    SEEDS, st.lists(st.sampled_from(list(product(*(SEVERITY.levels, SIDE.levels)))), max_size=60)
)
def test_within_each_stratum_groups_never_part_by_more_than_a_block(seed, people):
    scheme = Scheme(make_groups(1, 1), Method.BLOCKS, (SEVERITY, SIDE))
    done = allocate_all(scheme, Secret(seed, (2, 4)), people)
    for stratum in set(people):
        so_far: Counter[str] = Counter()
        for past in done:
            if past.levels == stratum:
                so_far[past.group] += 1
                assert abs(so_far["A"] - so_far["B"]) <= 2  # half of the largest block


@given(SEEDS)
def test_strata_do_not_follow_each_other(seed):
    scheme = Scheme(make_groups(1, 1), Method.BLOCKS, (SEVERITY,))
    alone = allocate_all(scheme, Secret(seed, (2, 4)), [("mild",)] * 8)
    mixed = allocate_all(scheme, Secret(seed, (2, 4)), [("mild",), ("severe",)] * 8)
    assert [past for past in mixed if past.levels == ("mild",)] == alone


@pytest.mark.parametrize("sizes", [(3,), (0,), (4, 5), (), (4, 4), (66,)])
def test_blocks_that_do_not_fit_the_ratio_are_refused_with_sizes_that_do(sizes):
    scheme = Scheme(make_groups(1, 1), Method.BLOCKS)
    with pytest.raises(InvalidSetting, match=r"such as “?[24], [46]"):
        scheme.check_secret(Secret("a long seed", sizes))


# --- minimization ---------------------------------------------------------------------------------


@given(SEEDS)
def test_minimization_keeps_every_level_near_balance(seed):
    scheme = Scheme(make_groups(1, 1), Method.MINIMIZATION, (SEVERITY, SIDE))
    people = [(SEVERITY.levels[i % 2], SIDE.levels[i // 2 % 2]) for i in range(80)]
    done = allocate_all(scheme, Secret(seed), people)
    for position, level in ((0, "mild"), (0, "severe"), (1, "left"), (1, "right")):
        counts = Counter(past.group for past in done if past.levels[position] == level)
        assert abs(counts["A"] - counts["B"]) <= 14  # by coins alone 5 % part by more than 12


def test_minimization_takes_the_best_group_as_often_as_it_says():
    groups = make_groups(1, 1, 1)
    earlier = [Allocated(("mild",), "A"), Allocated(("mild",), "B")]
    seeds = [f"seed number {n}" for n in range(4000)]
    drawn = Counter(minimization.choose_group(groups, earlier, ("mild",), 0.8, s) for s in seeds)
    assert abs(drawn["C"] / 4000 - 0.8) < 0.025
    assert abs(drawn["A"] - drawn["B"]) < 120


def test_unequal_ratios_are_what_minimization_balances_towards():
    scheme = Scheme(make_groups(2, 1), Method.MINIMIZATION, (SEVERITY,))
    counts = Counter(p.group for p in allocate_all(scheme, Secret("seed 2:1"), [("mild",)] * 150))
    assert 90 <= counts["A"] <= 110


def test_without_factors_or_with_certainty_there_is_no_minimization():
    with pytest.raises(InvalidSetting, match="at least one"):
        Scheme(make_groups(1, 1), Method.MINIMIZATION)
    for probability in (1.0, 0.5):
        with pytest.raises(InvalidSetting, match=r"such as 0\.8"):
            Scheme(make_groups(1, 1), Method.MINIMIZATION, (SIDE,), probability)


# --- lists ----------------------------------------------------------------------------------------

GOOD_LIST = "number,side,group\n1,left,A\n2,left,B\n1,right,B\n2,right,A\n"


def test_a_list_is_followed_within_each_stratum_and_ends_with_words():
    listed = lists.read_list(GOOD_LIST, make_groups(1, 1), [SIDE])
    scheme = Scheme(make_groups(1, 1), Method.LIST, (SIDE,))
    people = [("right",), ("left",), ("right",), ("left",)]
    secret = Secret("a long seed", listed=listed)
    done = allocate_all(scheme, secret, people)
    assert [past.group for past in done] == ["B", "A", "A", "B"]
    with pytest.raises(InvalidSetting, match=r"no further line \(left\)"):
        scheme.allocate(secret, done, ("left",))


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ("number,group\n1,A\n", "must name: number, side, group"),
        ("number,side,group\n1,left,A\n1,left,B\n", "Line 3: number 1 stands twice"),
        ("number,side,group\n1,left,A\n2,left,Z\n", "Its groups are: A, B"),
        ("number,side,group\n1,middle,A\n", "Choose one of: left, right"),
        ("number,side,group\n1,left,A\n3,left,B\n", "Number 2 is missing"),
        ("number,side,group\nx,left,A\n", "Count the participants from 1"),
        ("number,side,group\n1,left,A\n2,left,A\n", "nobody in group B"),
        ("number,side,group\n1,left\n", "no group “”"),
    ],
)
def test_a_list_that_cannot_be_followed_is_refused_with_the_cure(text, cure):
    with pytest.raises(InvalidSetting, match=cure):
        lists.read_list(text, make_groups(1, 1), [SIDE])


# --- concealment ----------------------------------------------------------------------------------


@given(SEEDS, st.sampled_from([Method.BLOCKS, Method.MINIMIZATION]))
def test_the_same_seed_allocates_the_same_again(seed, method):
    scheme = Scheme(make_groups(1, 1, 1), method, (SEVERITY,))
    people = [("mild",), ("severe",), ("mild",)] * 6
    secret = Secret(seed, (3, 6))
    again = Scheme.from_json(json.loads(json.dumps(scheme.to_json())))
    kept = Secret.from_text(secret.to_text())
    assert allocate_all(scheme, secret, people) == allocate_all(again, kept, people)


@given(SEEDS, SEEDS)
def test_what_stands_in_the_open_does_not_hold_the_secret(seed, other):
    assume(seed != other)
    scheme = Scheme(make_groups(1, 1), Method.BLOCKS, (SEVERITY,))
    secret = Secret(seed, (2, 4))
    told = json.dumps(scheme.to_json()) + secret.commitment
    assert seed not in told
    assert "block" not in json.dumps(scheme.to_json()).replace('"method": "blocks"', "")
    assert replace(secret, seed=other).commitment != secret.commitment
    assert replace(secret, block_sizes=(4,)).commitment != secret.commitment


@pytest.mark.parametrize("method", [Method.BLOCKS, Method.MINIMIZATION])
def test_the_next_group_is_open_whatever_came_before(method):
    """Of many seeds that led to the same open record, some go on with A and some with B."""
    scheme = Scheme(make_groups(1, 1), method, (SEVERITY,))
    people = [("mild",)] * 5
    going_on: dict[tuple[str, ...], Counter[str]] = {}
    for number in range(600):
        done = allocate_all(scheme, Secret(f"seed number {number}", (4, 8)), people)
        names = tuple(past.group for past in done)
        going_on.setdefault(names[:4], Counter())[names[4]] += 1
    often = {record: nexts for record, nexts in going_on.items() if nexts.total() >= 25}
    assert len(often) >= 4
    assert all(set(nexts) == {"A", "B"} for nexts in often.values())


# --- crossover ------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(2, 9))
def test_orders_balance_places_and_what_follows_what(count):
    arms = "ABCDEFGH"[:count]
    orders = williams_orders(arms)
    assert len(orders) == (count if count % 2 == 0 else 2 * count)
    for place in range(count):
        assert len(set(Counter(order[place] for order in orders).values())) == 1
    follows = Counter(pair for order in orders for pair in pairwise(order))
    assert len(follows) == count * (count - 1)
    assert len(set(follows.values())) == 1
    assert {frozenset(order) for order in orders} == {frozenset(arms)}


def test_a_crossover_allocates_orders():
    scheme = Scheme(crossover_groups("AB"), Method.BLOCKS)
    done = allocate_all(scheme, Secret("a long seed", (2,)), [()] * 4)
    assert Counter(past.group for past in done) == {"A-B": 2, "B-A": 2}


def test_visits_lie_apart_and_periods_further():
    planned = VisitPlan(visits=2, days_between=3, washout_days=14).plan(2, date(2026, 3, 2))
    assert [(v.number, v.period, v.day.isoformat()) for v in planned] == [
        (1, 0, "2026-03-02"),
        (2, 0, "2026-03-05"),
        (3, 1, "2026-03-19"),
        (4, 1, "2026-03-22"),
    ]
    for wrong in ({"visits": 0}, {"days_between": 0}, {"washout_days": 999}):
        with pytest.raises(InvalidSetting, match=r"1 to \d+"):
            VisitPlan(**wrong)


# --- arms -----------------------------------------------------------------------------------------

POSITIVE = Condition("positive", 1.0, 1.0, 1, 1)


def arm(code: str, condition: Condition = POSITIVE, weight: int = 1) -> ArmRule:
    return ArmRule(code, code.lower(), weight, condition)


def test_arms_differ_in_anything_or_are_refused():
    for other in (
        replace(POSITIVE, valence="negative"),
        replace(POSITIVE, gain=0.85),
        replace(POSITIVE, robot_intensity=0.0),
        replace(POSITIVE, measure=2),
        replace(POSITIVE, protocol=2),
    ):
        check_arms([arm("A"), arm("B", other)], crossover=False)
    with pytest.raises(InvalidSetting, match="Arms A and B do the same"):
        check_arms([arm("A"), arm("B")], crossover=False)


def test_worn_sensors_are_never_pooled_with_anything_else():
    check_channels(["", "heart_rate"])
    check_channels(["foot_strike_deg", "foot_strike_deg"])
    for other in ("", "heart_rate", "shank_stance_percent"):
        with pytest.raises(InvalidSetting, match="the same measure for all arms"):
            check_channels(["foot_strike_deg", other])


def test_arms_that_no_study_could_have_are_refused():
    negative = replace(POSITIVE, valence="negative")
    with pytest.raises(InvalidSetting, match="2 to 8 arms"):
        check_arms([arm("A")], crossover=False)
    with pytest.raises(InvalidSetting, match="the code A"):
        check_arms([arm("A"), arm("A", negative)], crossover=False)
    with pytest.raises(InvalidSetting, match="ratios at 1"):
        check_arms([arm("A"), arm("B", negative, weight=2)], crossover=True)
    with pytest.raises(InvalidSetting, match="capital letters"):
        arm("positive feedback")
    with pytest.raises(InvalidSetting, match="at least two"):
        Scheme((Group(("A",)),), Method.BLOCKS)
    many = tuple(Factor(f"f{n}", ("a", "b", "c")) for n in range(4))
    with pytest.raises(InvalidSetting, match="strata"):
        Scheme(make_groups(1, 1), Method.BLOCKS, many)


def test_an_arms_gain_changes_what_is_shown_with_feedback_alone():
    phases = (make_phase("baseline"), make_phase("training", gain=0.9))
    assert [p.gain for p in replace(POSITIVE, gain=0.8).apply_to(phases)] == [1.0, 0.9 * 0.8]
    with pytest.raises(InvalidSetting, match=r"0\.5 to 1\.5"):
        replace(POSITIVE, gain=0.5).apply_to(phases)

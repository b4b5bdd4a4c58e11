"""A starved computer: what priority the port's process gets, and what late pauses mean."""

import os

import pytest

from robot.port import priority
from robot.port.priority import explain_jitter, find_priority, measure_jitter, raise_priority


@pytest.mark.parametrize(
    ("refused", "given"),
    [
        ([], "real-time"),
        (["sched_setscheduler"], "raised"),
        (["sched_setscheduler", "setpriority"], "ordinary"),
    ],
)
def test_it_takes_what_the_rights_allow(monkeypatch, refused, given):
    done = []
    for name in ("sched_setscheduler", "setpriority"):

        def call(*arguments, name=name):
            if name in refused:
                raise PermissionError
            done.append((name, *arguments))

        monkeypatch.setattr(os, name, call, raising=False)
    monkeypatch.setattr(os, "SCHED_RR", 2, raising=False)
    monkeypatch.setattr(os, "sched_param", int, raising=False)
    monkeypatch.setattr(os, "PRIO_PROCESS", 0, raising=False)
    assert raise_priority() == given
    assert (
        done
        == {
            "real-time": [("sched_setscheduler", 0, 2, priority.REALTIME)],
            "raised": [("setpriority", 0, 0, priority.NICE)],
            "ordinary": [],
        }[given]
    )


def test_looking_at_it_changes_nothing_here():
    before = os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0)
    assert find_priority() in ("real-time", "raised", "ordinary")
    assert (os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0)) == before


@pytest.mark.parametrize(
    ("late_s", "means"), [(0.004, ""), (0.12, "come so much later"), (0.4, "ends by itself")]
)
def test_the_latest_pause_counts_and_says_what_it_means(late_s, means):
    now_s, pauses = 5.0, []

    def sleep(span_s):
        nonlocal now_s
        pauses.append(span_s)
        now_s += span_s + (late_s if len(pauses) == 40 else 0.0)

    worst_s = measure_jitter(lambda: now_s, sleep)
    assert worst_s == pytest.approx(late_s)
    assert means in explain_jitter(worst_s)
    assert bool(means) == ("/help/robot/" in explain_jitter(worst_s))

"""Hazards: kept until they are read; motion that nobody ordered."""

from robot.bases.hazards import SETTLED_S, StillWatch, UnreadHazards


def test_a_hazard_is_kept_until_it_is_read():
    unread = UnreadHazards()
    unread.add("bump", "cliff")
    unread.add("bump")
    assert unread.take() == {"bump", "cliff"}
    assert unread.take() == frozenset()


def moves_unordered(watch, speeds, now_s=100.0):
    """Return whether any of these speeds, 50 a second, was found to be unordered."""
    return any(watch.update(speed, now_s + 0.02 * n) for n, speed in enumerate(speeds))


def test_a_motion_that_nobody_ordered():
    assert moves_unordered(StillWatch(), [0.0] * 5 + [0.1] * 20)
    assert moves_unordered(StillWatch(), [-0.2] * 20)
    assert not moves_unordered(StillWatch(), [0.1] * 5 + [0.0] * 20)  # a shove
    assert not moves_unordered(StillWatch(), [0.02] * 100)


def test_a_motion_that_was_ordered_and_its_end():
    watch = StillWatch()
    watch.order_motion(100.0)
    end = round(SETTLED_S / 0.02)
    assert not moves_unordered(watch, [0.2] * (end - 1) + [0.0] * 50)
    watch.order_motion(100.0)
    assert moves_unordered(watch, [0.2] * (end + 20))

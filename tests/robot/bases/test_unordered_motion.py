"""Motion that nobody ordered."""

from robot.bases.unordered_motion import SETTLED_S, UnorderedMotion


def moves_unordered(motion, speeds, now_s=100.0):
    """Return whether any of these speeds, 50 a second, was found to be unordered."""
    return any(motion.update(speed, now_s + 0.02 * n) for n, speed in enumerate(speeds))


def test_a_motion_that_nobody_ordered():
    assert moves_unordered(UnorderedMotion(), [0.0] * 5 + [0.1] * 20)
    assert moves_unordered(UnorderedMotion(), [-0.2] * 20)
    assert not moves_unordered(UnorderedMotion(), [0.1] * 5 + [0.0] * 20)  # a shove
    assert not moves_unordered(UnorderedMotion(), [0.02] * 100)


def test_a_motion_that_was_ordered_and_its_end():
    motion = UnorderedMotion()
    motion.order_motion(100.0)
    end = round(SETTLED_S / 0.02)
    assert not moves_unordered(motion, [0.2] * (end - 1) + [0.0] * 50)
    motion.order_motion(100.0)
    assert moves_unordered(motion, [0.2] * (end + 20))

"""What synthetic walkers are compared with: a recorded protocol, and its usable strides."""

from rehab.training.phases import make_phase

# The protocol of HEBB_03, session 1 (docs/reference/gait.md#protocol): kind, percent shown,
# strides.
SESSION_1 = [
    make_phase(kind, f"{kind} {percent}", gain=percent / 100, strides=strides)
    for kind, percent, strides in (
        *(("baseline", 100, 54), ("catch", 100, 34), ("familiarization", 100, 30)),
        *(("catch", 100, 7), ("training", 100, 51), ("catch", 100, 12), ("training", 95, 48)),
        *(("catch", 100, 12), ("training", 90, 101), ("catch", 100, 12), ("training", 85, 107)),
        *(("catch", 100, 12), ("training", 85, 168), ("catch", 100, 13), ("training", 85, 230)),
        *(("catch", 100, 13), ("training", 85, 174), ("washout", 100, 552)),
    )
]


def usable(strides):
    """Return the values of the strides that have one and no reason against it."""
    return [m.value for m in strides if m.value is not None and not m.reasons]

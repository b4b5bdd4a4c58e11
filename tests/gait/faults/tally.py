"""What a fault did to the strides of a walk: how many A2 are wrong, how many strides are lost."""

from dataclasses import dataclass

from tests.gait.walks import pair_up

WRONG = 0.1  # of A2
NEAR_S = 0.1


@dataclass(frozen=True)
class Tally:
    """Counts of a leg's strides.

    ``strides`` are valid without the fault; ``lost`` of them are not valid with it, and ``wrong``
    are shown with an A2 that is off by more than a tenth. ``worst`` is the largest error shown,
    ``contacts_s`` are the errors of the valid strides' contacts, and ``doubts`` why none is shown
    until a person has looked.
    """

    strides: int
    lost: int
    wrong: int
    worst: float
    contacts_s: tuple[float, ...]
    doubts: tuple[str, ...] = ()


def count(found, clean, side="left") -> Tally:
    """Return the tally of one leg's strides that were found against those of the same walk."""
    own = [s for s in clean if s.side in (None, side) and s.valid]
    shown = [s for s in found if s.side in (None, side) and s.valid]
    pairs = pair_up(shown, [s.initial_contact_s for s in own])
    errors = [
        abs(one.a2_w_kg / other.a2_w_kg - 1)
        for one, other in zip(pairs, own, strict=True)
        if one is not None
    ]
    known = {id(one) for one in pairs if one is not None}
    others = [s.initial_contact_s for s in clean if s.side in (None, side)]
    strangers = sum(
        id(one) not in known and min(abs(one.initial_contact_s - o) for o in others) > NEAR_S
        for one in shown
    )
    contacts = [
        abs(getattr(one, name) - getattr(other, name))
        for one, other in zip(pairs, own, strict=True)
        if one is not None
        for name in ("initial_contact_s", "terminal_contact_s")
    ]
    return Tally(
        strides=len(own),
        lost=sum(one is None for one in pairs),
        wrong=sum(error > WRONG for error in errors) + strangers,
        worst=max(errors, default=0.0),
        contacts_s=tuple(sorted(contacts)),
    )

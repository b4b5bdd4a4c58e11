"""The five faults that no channel reveals: why, and what finds each before anybody walks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Hidden:
    """A fault that strides are shown with.

    Attributes
    ----------
    proof
        Why nothing in the channels tells it.
    found_by
        What does, in ``python -m rehab.gait check`` and on its page.
    begins
        How the names begin of what belongs to it in ``FAULTS``.
    """

    proof: str
    found_by: str
    begins: tuple[str, ...]


HIDDEN = {
    1: Hidden(
        "moment × gain has the curve, signs and times of a stronger ankle, and its lever on the "
        "force, 0.13-0.17 m (six people), stays that of a foot",
        "a file's plates and markers, from 0.88 and 1.12 on; 'lbf·ft would be as likely as Nm'; "
        "'its peak is … times too large' from 1.1 to 1.5 on, by the foot",
        ("moment × 0.7376", "moment × 0.8", "moment × 1.2"),
    ),
    2: Hidden(
        "angle × gain is the motion of another ankle: 0.05 rad in an orthosis, 0.4-0.6 else",
        "a knee's curve is not taken for an ankle's; 'its range is … times too large' from 1.8 on; "
        "below that a foot held at a known angle",
        ("angle × 0.8", "angle × 1.2", "angle × 1.56"),
    ),
    3: Hidden(
        "people brake from 2 ms before to 61 ms after the foot has left, and strides of one "
        "scatter by 8 ms: an angle that is out of time from the first stride on is another "
        "person's, as is a moment within 30 ms; a drift is seen by what strides scatter",
        "a file's plates and markers, the moment's from 10 and the angle's from 10 to 16 ms on; a "
        "synchronization pulse or heel drops; beyond what is known of people, strides are marked "
        "as unusual and their A2 as less sure",
        ("angle +", "angle -", "moment +", "moment -", "drift of"),
    ),
    4: Hidden(
        "plates that carry a twentieth less than a mass say what a handrail says, and a cane on "
        "the other belt that takes so much what a foot says that drags",
        "the mass as measured by the plates, and 'the other plate carries': from a tenth on "
        "strides wait until somebody has looked",
        ("mass ×", "cane"),
    ),
    5: Hidden(
        "samples made up before sending are like others: an even grid has no stalls, as nothing is "
        "left of the stamps that told them, and a curve drawn through a gap bends as an ankle does",
        "nothing: the lab has to send the device's own stamps, and to leave gaps open",
        ("even grid", "gaps of 100 ms filled by", "gaps of 200 ms filled by"),
    ),
}


def find_hidden(fault: str) -> int | None:
    """Return the number of the hidden fault that a fault of the bench is, if it is one."""
    found = [number for number, one in HIDDEN.items() if fault.startswith(one.begins)]
    return found[0] if found else None

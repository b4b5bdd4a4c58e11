"""What else a source measured in a session: the means of its extra values."""

from __future__ import annotations

from collections import Counter, defaultdict

from rehab.people.models import User
from rehab.sessions.formatting import format_significant
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.training.steps import SENT_VALUE

# A line of the page of paper has room for so many.
MAX_EXTRAS = 8
# Moments and marks of single strides, of which a mean says nothing.
WITHOUT_MEAN = ("initial_contact_s", SENT_VALUE)


def mean_extras(user: User, session: TrainingSession) -> list[str]:
    """Return "name mean" of the trained leg's valid strides, for what most of them have.

    Names are those that the source sent.
    """
    sums: defaultdict[str, float] = defaultdict(float)
    counts: Counter[str] = Counter()
    extras = Step.objects.visible_to(user).filter(
        session=session, side=session.trained_side, valid=True
    )
    for extra in extras.order_by("number").values_list("extra", flat=True).iterator():
        for name, value in extra.items():
            sums[name] += value
            counts[name] += 1
    names = [
        name
        for name, _count in counts.most_common()
        if name not in WITHOUT_MEAN and not name.startswith("flag_")
    ]
    return [
        f"{name} {format_significant(sums[name] / counts[name])}" for name in names[:MAX_EXTRAS]
    ]

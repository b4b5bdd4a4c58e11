"""What to look at where strides are rejected for a reason too often.

A sign, a unit or a delay is named as a question, never as the cure: people may walk like that.
"""

from __future__ import annotations

from rehab.gait.strides import RejectionReason

# Other reasons are the walker's own, or follow from the samples' times.
CURES = {
    RejectionReason.TIME_BACKWARDS: (
        "The clock stands still or jumps back. Send the sensors' own times."
    ),
    RejectionReason.GAP: (
        "Samples are lost for more than 50 ms. Look at the network and the recorder."
    ),
    RejectionReason.LATE: (
        "Samples come late while the foot pushes off, and the lab's inverse dynamics takes that "
        "for a slower motion. Close other programs on the lab's computer."
    ),
    RejectionReason.FORCE_LOST: (
        "The vertical force breaks off while the foot stands. Look at the plate."
    ),
    RejectionReason.FORCE_TOO_LARGE: (
        "The vertical force is more than twice the body weight, unusual for walking. Check the "
        "body mass and the unit of force by a known weight on the plate."
    ),
    RejectionReason.LONG_STANCE: (
        "The foot does not leave its plate. Zero the plate, or start the belt."
    ),
    RejectionReason.CROSS_STEP: (
        "Both feet often stand on one plate. Ask for wider steps, and check that both plates send."
    ),
    RejectionReason.WEIGHT: (
        "The two plates together do not carry this person. Check the body mass and the unit of "
        "force."
    ),
    RejectionReason.MOMENT_LOST: (
        "The ankle moment is missing, frozen or jumps. Look at its channel."
    ),
    RejectionReason.MOMENT_SIGN: (
        "The ankle moment is negative through most of stance; here plantarflexion is positive. "
        "Look up which sign the lab's system gives it."
    ),
    RejectionReason.MOMENT_TOO_SMALL: (
        "The ankle moment is next to nothing. Look up its unit and whether it is by body mass; it "
        "is right for a foot that is hardly loaded in front."
    ),
    RejectionReason.MOMENT_TOO_LARGE: (
        "The ankle moment is larger than any known of walking. Look up its unit and check the body "
        "mass."
    ),
    RejectionReason.MOMENT_IN_SWING: (
        "The ankle moment does not vanish while the foot swings. Check that force and moment "
        "are of the same leg, and that the plate is zeroed before inverse dynamics."
    ),
    RejectionReason.MOMENT_OUT_OF_STEP: (
        "The ankle moment does not fit to the force under the foot: both feet on one plate, or "
        "another leg's, time or unit. Compare the two curves (--plot)."
    ),
    RejectionReason.ANGLE_LOST: (
        "The ankle angle is missing, frozen or jumps. Look at markers or sensor."
    ),
    RejectionReason.ANGLE_FLAT: (
        "The ankle angle hardly moves. Check the channel and its unit; it is right for a rigid "
        "orthosis, which has no A2."
    ),
    RejectionReason.ANGLE_TOO_LARGE: (
        "The ankle angle moves more than any ankle can. Look up its unit."
    ),
    RejectionReason.ANGLE_OUT_OF_STEP: (
        "The ankle turns back before the foot leaves, which is unusual. Compare angle and force "
        "(--plot): another leg's, another time, or how this person walks."
    ),
    RejectionReason.POWER_REVERSED: (
        "The ankle brakes where most push; here plantarflexion is positive. Look up which sign the "
        "lab's system gives the angle."
    ),
    RejectionReason.NO_PUSH_OFF: (
        "No push-off is found. Check that moment and angle are of the same leg as the force, and "
        "their signs; it is right for a foot that is lifted without pushing."
    ),
    RejectionReason.OUT_OF_BOUNDS: (
        "Push-off power is larger than any known of walking. Look up the units of moment and angle."
    ),
}

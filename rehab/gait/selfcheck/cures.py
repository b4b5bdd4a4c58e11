"""What to put right where strides are rejected for a reason too often."""

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
        "The vertical force is more than twice the body weight. Send it in newtons and check "
        "the body mass."
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
        "The ankle moment has the wrong sign. Turn it: plantarflexion is positive."
    ),
    RejectionReason.MOMENT_TOO_SMALL: (
        "The ankle moment is next to nothing. Send newton meters, not kilonewton meters or "
        "newton meters per kilogram."
    ),
    RejectionReason.MOMENT_TOO_LARGE: (
        "The ankle moment is larger than anybody's. Send newton meters, not newton millimeters, "
        "and check the body mass."
    ),
    RejectionReason.MOMENT_IN_SWING: (
        "The ankle moment does not vanish while the foot swings. Check that force and moment "
        "are of the same leg and in time, and zero the plate."
    ),
    RejectionReason.MOMENT_OUT_OF_STEP: (
        "The ankle moment is too large for the force under the foot. Check that both are of the "
        "same leg and in time, and the units."
    ),
    RejectionReason.ANGLE_LOST: (
        "The ankle angle is missing, frozen or jumps. Look at markers or sensor."
    ),
    RejectionReason.ANGLE_FLAT: (
        "The ankle angle hardly moves. Send radians, and check the channel."
    ),
    RejectionReason.ANGLE_TOO_LARGE: (
        "The ankle angle moves more than any ankle. Send radians, not degrees."
    ),
    RejectionReason.ANGLE_OUT_OF_STEP: (
        "The ankle angle does not fit to the force. Check that both are of the same leg and in "
        "time."
    ),
    RejectionReason.POWER_REVERSED: (
        "The ankle seems to brake where it should push. Turn the sign of the angle: "
        "plantarflexion is positive."
    ),
    RejectionReason.NO_PUSH_OFF: (
        "No push-off is found. Check the signs of moment and angle, and that they are of the "
        "same leg as the force."
    ),
    RejectionReason.OUT_OF_BOUNDS: (
        "Push-off power is larger than anybody's. Check the units of moment and angle."
    ),
}

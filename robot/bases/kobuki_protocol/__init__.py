"""The protocol of a Kobuki, pure: commands and feedback, both ways, for driver and twin alike.

``frames`` finds and makes frames, ``commands`` and ``feedback`` are what they hold, ``wheels``
turns twists into commands and back, ``frame_filter`` makes estimates of a damaged stream.
"""

"""The twin: a Kobuki that is simulated down to its bytes, for the driver that drives a real one.

``bodies`` roll (``bullet`` with physics), ``firmware`` answers for one, ``faults`` are what can go
wrong, ``lines`` is where it is plugged in, ``process`` runs it by the clock.
"""

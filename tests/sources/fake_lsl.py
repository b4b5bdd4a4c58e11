"""What is used of pylsl, in memory: outlets of other clocks, read from threads."""

import queue


class LostError(RuntimeError):
    """As pylsl has it."""


class FakeOutlet:
    """A stream: its description, and samples on their way."""

    def __init__(self, name, labels, rate_hz, ahead_s) -> None:
        self._name, self.labels, self.rate_hz = name, labels, rate_hz
        self.clock_s = 50.0
        self.vanishes = False  # once, while it is opened
        self.ahead_s = ahead_s  # how far our clock is ahead of the sender's
        self.samples: queue.Queue[tuple[list[object], float]] = queue.Queue()

    def push(self, sample, *, step_s) -> None:
        self.clock_s += step_s
        self.samples.put((sample, self.clock_s))

    # --- StreamInfo ---

    def name(self):
        return self._name

    def type(self):
        return "Gait"

    def source_id(self):
        return f"{self._name}-1"

    def hostname(self):
        return "lab"

    def channel_count(self):
        return len(self.labels)

    def nominal_srate(self):
        return self.rate_hz

    def get_channel_labels(self):
        return list(self.labels)


class FakeInlet:
    def __init__(self, info, max_buflen=360, processing_flags=0) -> None:
        self._outlet = info

    def info(self, timeout):
        if self._outlet.vanishes:
            self._outlet.vanishes = False
            raise LostError("the stream has been lost.")
        return self._outlet

    def time_correction(self, timeout):
        return self._outlet.ahead_s

    def pull_sample(self, timeout):
        try:
            return self._outlet.samples.get(timeout=timeout)
        except queue.Empty:
            return None, None

    def pull_chunk(self, timeout, max_samples):
        found: list[tuple[list[object], float]] = []
        while not self._outlet.samples.empty() and len(found) < max_samples:
            found.append(self._outlet.samples.get())
        return [sample for sample, _ in found], [stamp for _, stamp in found]

    def close_stream(self):
        pass


class FakeLsl:
    proc_dejitter, proc_monotonize = 2, 4
    StreamInlet = FakeInlet

    def __init__(self) -> None:
        self.outlets: list[FakeOutlet] = []

    def add(self, name, labels, rate_hz=0.0, ahead_s=0.0) -> FakeOutlet:
        self.outlets.append(FakeOutlet(name, labels, rate_hz, ahead_s))
        return self.outlets[-1]

    def resolve_streams(self, _wait_time):
        return list(self.outlets)

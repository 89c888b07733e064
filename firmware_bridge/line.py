"""What the line to the vehicle carries, measured: round trip, share of frames that arrive, bytes per second.

A line that is given more than it carries drops most of it; a radio drops some of whatever it is given. The two are told
apart by an experiment: the vehicle is asked to send what arrived, no more. If the loss falls the line was full, and the
limit stays; if it does not, the radio is bad, and sending less helps nobody.
"""

from dataclasses import dataclass

_WINDOW_S = 0.5
_LEAST_FRAMES = 8  # fewer say little about a ratio
_LONGEST_WINDOW_S = 3.0
_CROWDED_LOSS = 0.5
_CLEAN_LOSS = 0.1
_TRIALS = 3  # windows after which the loss must have fallen
_TRUST_S = 30.0  # a bad radio is not suspected of being full again before
_PROBE_S = 10.0  # a limit that was found is not tried again before
_LARGEST_LIMIT_BYTES_S = 1e5  # all telemetry together takes a fifth of it
_LONGEST_DEVIATION_S = 0.03
_SEQUENCES = 256
_LATE = 200  # a step this large in the sequence is one that was overtaken


@dataclass(slots=True)
class RoundTrip:
    """Smoothed round trip and its variation (Jacobson 1988; RFC 6298)."""

    mean_s: float = 0.0
    """0 before the first measurement."""
    deviation_s: float = 0.0

    def measured(self, rtt_s: float) -> None:
        if self.mean_s <= 0.0:
            self.mean_s, self.deviation_s = rtt_s, 0.5 * rtt_s
            return
        self.deviation_s += 0.25 * (abs(rtt_s - self.mean_s) - self.deviation_s)
        self.mean_s += 0.25 * (rtt_s - self.mean_s)

    @property
    def longest_s(self) -> float:
        """An answer that has not come by then is lost; 0 before the first measurement."""
        return self.mean_s + min(4.0 * self.deviation_s, self.mean_s + _LONGEST_DEVIATION_S)


@dataclass(slots=True)
class Window:
    """What came from the vehicle over a short while."""

    began_s: float
    arrived: int = 0
    lost: int = 0
    arrived_bytes: int = 0
    lasted_s: float = 0.0
    """0 while it lasts."""

    @property
    def loss_ratio(self) -> float:
        return self.lost / max(self.arrived + self.lost, 1)

    @property
    def bytes_s(self) -> float:
        return self.arrived_bytes / max(self.lasted_s, 1e-3)


class LineMeter:
    """Follows the frames from the vehicle; `limit_bytes_s` is what it should be asked to keep to."""

    def __init__(self) -> None:
        self.round_trip = RoundTrip()
        self.limit_bytes_s = 0.0
        """0: no limit was found."""
        self.last: Window | None = None
        """The newest window that is over."""
        self._window: Window | None = None
        self._sequence = -1
        self._crowded = self._trials = 0
        self._loss_before = 0.0
        self._raised = self._obeyed = False
        self._trust_until_s = self._probe_at_s = float("-inf")

    def received(self, sequence: int, frame_bytes: int, now_s: float) -> None:
        """A frame of the vehicle: 8-bit sequence number and length."""
        window = self._window = self._window or Window(now_s)
        step = (sequence - self._sequence) % _SEQUENCES if self._sequence >= 0 else 1
        if step < _LATE:
            self._sequence = sequence
            window.lost += max(step - 1, 0)
        else:
            window.lost = max(window.lost - 1, 0)
        window.arrived += 1
        window.arrived_bytes += frame_bytes
        window.lasted_s = now_s - window.began_s
        enough = window.arrived + window.lost >= _LEAST_FRAMES and window.lasted_s >= _WINDOW_S
        if enough or window.lasted_s >= _LONGEST_WINDOW_S:
            self.last, self._window = window, Window(now_s)
            self._judge(window, now_s)

    def reported(self, limit_bytes_s: float, now_s: float) -> None:
        """The vehicle has answered a report of this limit: what it sends from here on keeps to it."""
        if not self._obeyed and limit_bytes_s > 0.0 and limit_bytes_s == self.limit_bytes_s:  # the very same, kept
            self._obeyed, self._window = True, Window(now_s)

    def _judge(self, window: Window, now_s: float) -> None:
        crowded = window.loss_ratio > _CROWDED_LOSS
        if self.limit_bytes_s > 0.0:
            self._review(window, crowded, now_s)
            return
        self._crowded = self._crowded + 1 if crowded else 0
        if self._crowded >= 2 and now_s >= self._trust_until_s:
            self.limit_bytes_s, self._loss_before = window.bytes_s, window.loss_ratio
            self._trials, self._raised = 0, False
        self._obeyed = False

    def _review(self, window: Window, crowded: bool, now_s: float) -> None:
        """Lower a limit that is still too high, lift one that does not help, raise one that loses nothing."""
        if not self._obeyed:
            return
        before = self.limit_bytes_s
        if crowded:
            self._trials += 1
            self.limit_bytes_s = min(self.limit_bytes_s, window.bytes_s)
            if self._trials >= _TRIALS and window.loss_ratio > 0.8 * self._loss_before:
                self.limit_bytes_s, self._trust_until_s = 0.0, now_s + _TRUST_S
        elif window.loss_ratio >= _CLEAN_LOSS:
            if self._raised:
                self.limit_bytes_s, self._raised, self._probe_at_s = 0.95 * window.bytes_s, False, now_s + _PROBE_S
        elif now_s >= self._probe_at_s:
            self._trials, self._raised = 0, True
            self.limit_bytes_s *= 1.25
            if self.limit_bytes_s > _LARGEST_LIMIT_BYTES_S:
                self.limit_bytes_s = 0.0
        self._obeyed = before == self.limit_bytes_s

    def words(self) -> str:
        """What was measured, for an error."""
        window = self.last or self._window
        if window is None:
            return "nothing was measured of the line"
        share = f"{window.arrived} of the last {window.arrived + window.lost} frames from it arrived"
        trip = f", round trip {self.round_trip.mean_s:.2g} s" if self.round_trip.mean_s > 0.0 else ""
        return f"{share}, {window.bytes_s * 1e-3:.2g} kB/s{trip}"

"""The errors Goshawk raises on purpose; everything else is a bug."""


class FlightError(Exception):
    """Base of all expected failures. The message names the value, the bound and the remedy."""


class InputError(FlightError):
    """An argument or a file's content is invalid: not finite, wrong shape, out of range, missing."""


class FormatError(FlightError):
    """A file cannot be decoded: truncated, of another format, or of a newer version."""


class InfeasibleError(FlightError):
    """The problem is well posed and has no solution within the limits; the message says which limit."""


class MapError(FlightError):
    """These images do not suffice for mapping or localization."""


class LinkError(FlightError):
    """The vehicle did not answer, or refused the request."""

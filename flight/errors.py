"""The errors Goshawk raises on purpose; everything else is a bug."""


class FlightError(Exception):
    """Base of all expected failures. The message names the value, the bound and the way out."""


class InputError(FlightError):
    """What was handed in cannot be used: not finite, wrong shape, out of range, missing."""


class FormatError(FlightError):
    """A file is not what it says it is: truncated, of another format, or of a newer version."""


class InfeasibleError(FlightError):
    """The problem is well posed and has no answer within the limits; the message says which limit."""


class MapError(FlightError):
    """Mapping or localization could not do its work with these images."""


class LinkError(FlightError):
    """The vehicle did not answer, or refused."""

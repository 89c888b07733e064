"""Units that exist only at the screen and in foreign files, in SI."""

import math

RAD_S_PER_RPM = 2.0 * math.pi / 60.0
"""One revolution per minute in radians per second."""

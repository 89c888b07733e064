"""What measurements say about the vehicle: read and check logs, identify, compare."""

from sysid import plots
from sysid.comparison import Comparison, compare
from sysid.identification import identify
from sysid.options import Options
from sysid.result import Estimate, Identification

__all__ = ["Comparison", "Estimate", "Identification", "Options", "compare", "identify", "plots"]

"""What measurements say about the vehicle: read and check logs, identify, compare."""

from sysid import plots
from sysid.comparison import Comparison, compare
from sysid.identification import identify
from sysid.log_check import LogReport, check_log
from sysid.options import Options
from sysid.reading import read_log
from sysid.result import Estimate, Identification

__all__ = [
    "Comparison",
    "Estimate",
    "Identification",
    "LogReport",
    "Options",
    "check_log",
    "compare",
    "identify",
    "plots",
    "read_log",
]

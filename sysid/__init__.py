"""What measurements say about the vehicle: read and check logs, identify, compare."""

from sysid import plots, report
from sysid.comparison import Comparison, compare
from sysid.identification import identify
from sysid.log_check import LogReport, check_log
from sysid.options import Options
from sysid.reading import read_log
from sysid.result import Estimate, Identification
from sysid.stages import identify_in_stages, regress

__all__ = [
    "Comparison",
    "Estimate",
    "Identification",
    "LogReport",
    "Options",
    "check_log",
    "compare",
    "identify",
    "identify_in_stages",
    "plots",
    "read_log",
    "regress",
    "report",
]

"""What was found, for people: pages of HTML and the pictures on them."""

from sysid.report.pages import write, write_comparison

__all__ = ["write", "write_comparison"]

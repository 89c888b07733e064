"""Progress of a part as progress of the whole."""

from flight import within


def test_a_part_reports_its_share_of_the_whole():
    seen = []
    part = within(lambda stage, fraction: seen.append((stage, fraction)), "diagnose", 0.2, 0.6)
    for fraction in (0.0, 0.5, 1.0):
        part("identify", fraction)
    assert seen == [("diagnose", 0.2), ("diagnose", 0.4), ("diagnose", 0.6)]

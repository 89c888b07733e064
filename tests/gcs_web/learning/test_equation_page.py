"""An equation that a diagnosis proposes becomes an effect file on the page, with one button."""

import msgspec
import numpy as np
import pytest

import vehicle
from flight import file_format
from gcs_web.flights import reading
from gcs_web.learning import diagnosis_values, learning
from gcs_web.protocol.learning import Diagnosis
from sysid.diagnosis import OutsideFinding
from sysid.diagnosis.equation import Equation, Term
from sysid.diagnosis.evidence.forms import forms
from sysid.diagnosis.evidence.laws import Axis
from tests.gcs_web.in_browser import needs_chromium
from tests.waiting import until as wait

pytestmark = needs_chromium

AT = np.linspace(-4.0, 4.0, 33)
CURVE = OutsideFinding("F_y", "v_y", "m/s", AT, -0.3 * AT, np.full(len(AT), 0.02), 0.7, 9.0, 1e-6, 0.9)
LAW = Equation(forms("v_y")[0], 0.0, (Term(Axis("F_y", "v_y"), -0.21, 0.002),), False, "", 0.9, (), 4.0, 0.0, 1.0)


@pytest.fixture(params=[CURVE, None], ids=["of a curve", "beside a named effect"])
def proposed(request, station):
    """A diagnosis of the station's project with an equation, of a curve or alone, shown on its pages."""
    opened = station.desk.project
    shown = Diagnosis(
        "current",
        "Something unknown is missing.",
        outside=None if request.param is None else diagnosis_values._outside(request.param),
        equation=diagnosis_values._equation(LAW),
        vehicle=vehicle.vehicle_hash(vehicle.load(opened.vehicle)),
        logs=reading.contents(opened, []),
    )
    file = learning.diagnosis_file(opened.folder)
    file_format.write_bytes(file, msgspec.json.encode(shown))
    station.desk.show_learning()
    yield
    file.unlink()
    station.desk.show_learning()


def test_one_button_makes_an_effect_of_the_proposed_equation(station, proposed, page):
    page.keyboard.press("5")
    page.get_by_text("F_y = -a v_y, a = 0.21").wait_for()
    assert page.get_by_label("Name of the effect").input_value() == "f_y_of_v_y"
    assert page.get_by_label("Function").input_value() == "equation"
    page.get_by_role("button", name="Make an effect of it").click()
    file = learning.own_effects(station.desk.project.folder) / "f_y_of_v_y.py"
    wait(file.is_file, "the effect file")
    assert 'law="F_y = -a v_y"' in file.read_text()
    page.get_by_role("button", name="Read f_y_of_v_y.py").wait_for()
    file.unlink()

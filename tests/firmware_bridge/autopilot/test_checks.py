"""What of an autopilot's parameters is refused before anything is armed, and what it says it does without us."""

import struct
from dataclasses import replace

import pytest

from firmware_bridge.autopilot import checks, thrust
from firmware_bridge.autopilot.flavour import ARDUPILOT, PX4, refusal
from firmware_bridge.autopilot.line import parsed
from firmware_bridge.autopilot.settings import Settings, number
from firmware_bridge.autopilot.setup import AutopilotSetup
from firmware_bridge.dialect.generated.messages import ParamValue
from firmware_bridge.offboard.thrust_map import ThrustMap
from flight import InputError
from tests.firmware_bridge.autopilot.simulated_autopilot import PARAMETERS

BY_FILE, WEIGHT_N = ThrustMap((0.1, 3.0, 22.0)), 6.9


def found(kind: str, **other: float | None) -> Settings:
    flavour = {"px4": PX4, "ardupilot": ARDUPILOT}[kind]
    values = {name: float(value) for name, value in PARAMETERS[kind].items()}
    values[flavour.hover] = thrust.of(flavour, values, BY_FILE).command(WEIGHT_N)
    values |= {name: value for name, value in other.items() if value is not None}
    return Settings(flavour, 1, {name: value for name, value in values.items() if other.get(name, 0.0) is not None})


def failed(told: Settings) -> list[str]:
    by_file = thrust.of(told.flavour, told.parameters, BY_FILE)
    return [check.name for check in checks.checks(told, weight_n=WEIGHT_N, thrust=by_file) if not check.passed]


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_one_that_is_set_up_as_the_page_says_passes(kind):
    assert not failed(found(kind))


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        ("px4", "COM_OF_LOSS_T", 1.0),
        ("px4", "COM_OF_LOSS_T", None),
        ("px4", "COM_OBL_RC_ACT", 6.0),
        ("px4", "COM_OBL_RC_ACT", 7.0),
        ("px4", "COM_OBL_RC_ACT", 99.0),
        ("px4", "COM_OBL_RC_ACT", None),
        ("px4", "MPC_THR_HOVER", 0.9),
        ("px4", "MPC_THR_HOVER", None),
        ("ardupilot", "GUID_TIMEOUT", 3.0),
        ("ardupilot", "GUID_OPTIONS", 0.0),
        ("ardupilot", "GUID_OPTIONS", None),
        ("ardupilot", "ATC_ANGLE_BOOST", 1.0),
        ("ardupilot", "ATC_ANGLE_BOOST", None),
        ("ardupilot", "FS_GCS_ENABLE", 0.0),
        ("ardupilot", "FS_GCS_ENABLE", None),
        ("ardupilot", "MOT_THST_HOVER", 0.6),
    ],
)
def test_one_wrong_or_untold_parameter_is_refused_by_its_name(kind, name, value):
    told = found(kind, **{name: value})
    assert failed(told) == [name]


def test_another_station_of_our_id_is_refused_where_a_lost_link_is_to_be_noticed():
    assert failed(replace(found("ardupilot"), stations=frozenset({255}))) == ["SYSID_MYGCS"]
    assert not failed(replace(found("ardupilot"), stations=frozenset({254})))
    assert not failed(replace(found("px4"), stations=frozenset({255})))


def test_where_the_pilot_arms_by_radio_guided_must_let_him():
    told = found("ardupilot")
    by_file = thrust.of(ARDUPILOT, told.parameters, BY_FILE)
    (check,) = [c for c in checks.checks(told, weight_n=WEIGHT_N, thrust=by_file, arms=False) if not c.passed]
    assert "set GUID_OPTIONS to 9" in str(check)


def test_an_origin_that_was_told_must_have_been_taken():
    told = found("px4")
    by_file = thrust.of(told.flavour, told.parameters, BY_FILE)
    for known in (False, True):
        conditions = checks.checks(
            replace(told, origin_known=known), weight_n=WEIGHT_N, thrust=by_file, origin=True
        )  # fmt: skip
        assert [check.name for check in conditions if not check.passed] == ([] if known else ["origin"])


def test_armed_is_refused():
    assert failed(replace(found("px4"), armed=True)) == ["armed"]


def test_the_other_options_of_guided_stay_in_the_remedy():
    told = found("ardupilot", GUID_OPTIONS=5.0)
    by_file = thrust.of(ARDUPILOT, told.parameters, BY_FILE)
    (check,) = [c for c in checks.checks(told, weight_n=WEIGHT_N, thrust=by_file) if not c.passed]
    assert "set GUID_OPTIONS to 13" in str(check)


@pytest.mark.parametrize(
    ("kind", "other", "words"),
    [
        ("px4", {"COM_OBL_RC_ACT": 4.0}, "for 0.5 s, then: lands where it is"),
        ("px4", {"COM_OBL_RC_ACT": 0.0}, "position mode, which needs a pilot's sticks"),
        ("ardupilot", {}, "for 0.5 s, then is level at its height, and after 5 s, "),
        ("ardupilot", {"SYSID_MYGCS": 250.0}, "only if no other station sends as 250: lands where it is"),
        ("ardupilot", {"FS_GCS_ENABLE": 1.0}, "returns and lands"),
    ],
)
def test_what_happens_without_us_is_said_by_the_parameters(kind, other, words):
    assert words in checks.when_we_die(found(kind, **other))


def test_whole_numbers_of_px4_lie_in_the_floats_bits():
    (bits,) = struct.unpack("<f", struct.pack("<i", 7))
    assert number(ParamValue(param_value=bits, param_type=6), PX4) == 7.0
    assert number(ParamValue(param_value=7.0, param_type=6), ARDUPILOT) == 7.0
    assert number(ParamValue(param_value=0.5, param_type=9), PX4) == 0.5


@pytest.mark.parametrize(
    ("kind", "other"), [("px4", {"THR_MDL_FAC": 0.0}), ("px4", {"THR_MDL_FAC": 0.3}), ("ardupilot", {})]
)
def test_thrust_and_force_are_inverse_and_go_through_hover(kind, other):
    told = found(kind, **other)
    shape = thrust.of(told.flavour, told.parameters, BY_FILE).through(0.4, WEIGHT_N)
    assert shape.force_n(0.4) == pytest.approx(WEIGHT_N)
    assert shape.through(0.5, WEIGHT_N).force_n(0.5) == pytest.approx(WEIGHT_N)
    for command in (0.1, 0.35, 0.8):
        assert shape.command(shape.force_n(command)) == pytest.approx(command, abs=1e-9)


def test_a_setup_survives_the_way_to_the_guard():
    shape = thrust.AutopilotThrust(BY_FILE, linear=False, quadratic_share=0.2, ratio=1.1)
    setup = AutopilotSetup("mavlink:udp://127.0.0.1:1", 1, 255, 6 << 16, 6, True, shape, 0.7, 9.8, "h", 1, 0.0)
    assert AutopilotSetup.from_json(setup.to_json()) == setup


def test_what_is_refused_is_said_in_words():
    assert refusal(400, 2) == "arming denied"
    assert refusal(176, 1) == "the mode rejected for now"
    assert refusal(400, 0) == refusal(400, 5) == ""
    assert refusal(31000, 77) == "command 31000 answered with 77"


def test_an_address_may_name_the_origin_and_ask_for_poses_to_be_passed_on():
    address = parsed("mavlink:udpin://127.0.0.1:14540?origin=47.4,8.5,400&vision=on")
    assert (address.host, address.port, address.waits) == ("127.0.0.1", 14540, True)
    assert address.origin == (47.4, 8.5, 400.0)
    assert address.vision


@pytest.mark.parametrize(
    "text",
    ["mavlink:tcp://127.0.0.1:5760", "mavlink:udp://127.0.0.1", "mavlink:udp://127.0.0.1:1?origin=91,0,0",
     "mavlink:udp://127.0.0.1:1?origin=1,2", "mavlink:udp://127.0.0.1:1?vision=yes", "mavlink:udp://127.0.0.1:1?x=1",
     *(f"mavlink:udp://127.0.0.1:1?origin=47,8,{altitude}" for altitude in ("nan", "inf", "1e9")),
     "mavlink:udp://127.0.0.1:1?origin=nan,8,1", "mavlink:udp://[::1]:14540",
     "mavlink:udp://127.0.0.1:1?targets=velocity"],
)  # fmt: skip
def test_another_address_is_refused_with_the_form(text):
    with pytest.raises(InputError, match=r"give mavlink:udp://127.* \?origin=LAT,LON,ALT&vision=on&targets=position"):
        parsed(text)


@pytest.mark.parametrize("host", ["192.168.4.1", "vehicle.local", "0.0.0.0"])
def test_until_an_autopilot_has_flown_only_this_machine_is_flown(host):
    with pytest.raises(InputError, match="flown neither PX4 nor ArduPilot"):
        parsed(f"mavlink:udp://{host}:14550")


@pytest.mark.parametrize(("kind", "rotors"), [(2, 4), (13, 6), (14, 8)])
@pytest.mark.parametrize(("name", "way"), [("px4", "set CA_ROTOR_COUNT"), ("ardupilot", "set FRAME_CLASS")])
def test_the_heartbeat_must_be_of_as_many_rotors_as_the_file_has(kind, rotors, name, way):
    told = replace(found(name), kind=kind)
    assert checks.as_many_rotors(told, rotors).passed
    wrong = checks.as_many_rotors(told, 5)
    assert not wrong.passed
    assert f"a vehicle of {rotors} (MAV_TYPE {kind}), the vehicle file has 5" in str(wrong)
    assert way in str(wrong)


def test_a_kind_that_tells_no_number_of_rotors_passes():
    assert checks.as_many_rotors(replace(found("px4"), kind=29), 6).passed

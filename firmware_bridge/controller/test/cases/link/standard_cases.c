/* Commands of standard ground stations, one law each: what is carried out, refused and why, repeated. */
#include "standard_cases.h"

#include <math.h>
#include <string.h>

#include "link_cases.h"

enum { ACCEPTED = 0, TEMPORARILY_REJECTED = 1, DENIED = 2, UNSUPPORTED = 3 };
enum { ARM = 400, TAKE_OFF = 22, LAND = 21, MODE = 176, TERMINATE = 185, REPOSITION = 192, PAUSE = 193 };
enum { INTERVAL = 511, CONTROL = 32100, MISSION_START = 300 };

static const trouble none = {0};
static command_ack_msg ack; /* the last one */

/* Flies for a while with the link. */
static uint8_t go(float seconds) {
    uint64_t time_us = controller.telemetry.time_us;
    for (unsigned i = 0; i < (unsigned)(seconds * 100.0f); i++) {
        (void)run(&controller, &time_us, 0.0101f, &none);
        clock_us += 10000u;
        tc_link_update(&ln, clock_us);
        if (i % 100u == 99u) lease(PILOT, 1);
    }
    return controller.mission.state;
}

/* The result of a command with the parameters p[0] to p[6]; in `ack` all of its acknowledgement. */
static uint8_t send_long(uint8_t system, unsigned command, const float p[7], uint8_t confirmation) {
    memset(&ack, 0xFF, sizeof ack);
    SEND(system, COMMAND_LONG, command_long, TO_VEHICLE, .command = (uint16_t)command, .param1 = p[0], .param2 = p[1],
         .param3 = p[2], .param4 = p[3], .param5 = p[4], .param6 = p[5], .param7 = p[6], .confirmation = confirmation);
    const uint8_t* payload = answer(COMMAND_ACK_ID);
    if (payload == NULL) return UINT8_MAX;
    command_ack_decode(&ack, payload, COMMAND_ACK_LENGTH);
    must(ack.command == command, "it is this command that is acknowledged");
    must(ack.target_system == system && ack.target_component == 190u, "to the one who asked");
    return ack.result;
}

static uint8_t command(uint8_t system, unsigned id, float p1, float p2, float p3, float p7) {
    const float p[7] = {p1, p2, p3, NAN, NAN, NAN, p7};
    return send_long(system, id, p, 0);
}

static uint8_t pilot(unsigned id, float p1, float p2, float p7) { return command(PILOT, id, p1, p2, 0.0f, p7); }

void standard_begin(void) {
    start_link(false, 0);
    controller.parameters.fence_max_world_m[2] = 40.0f;
    lease(PILOT, 1);
    (void)go(0.1f);
    (void)answer(0);
}

void standard_hovering(void) {
    standard_begin();
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED, "arms");
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 1.0f) == ACCEPTED, "takes off");
    must(go(6.0f) == TC_HOLD, "hovers");
    (void)answer(0);
}

uint32_t mode_shown(void) {
    heartbeat_msg m;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 0.0f);
    const uint8_t* payload = answer(HEARTBEAT_ID);
    must(payload != NULL, "a heartbeat on request");
    heartbeat_decode(&m, payload, HEARTBEAT_LENGTH);
    return m.custom_mode;
}

uint32_t px4_mode(uint32_t main, uint32_t sub) { return (main << 16) | (sub << 24); }

static void arming_and_disarming(void) {
    standard_begin();
    must(command(OTHER, ARM, 1.0f, 0.0f, 0.0f, 0.0f) == TEMPORARILY_REJECTED, "of a station not in control");
    must(ack.result_param2 == TC_LINK_NOT_IN_CONTROL && controller.mission.state == TC_DISARMED, "and not carried out");
    must(pilot(ARM, 1.0f, 21196.0f, 0.0f) == UNSUPPORTED, "the arming check cannot be skipped");
    must(pilot(ARM, 2.0f, 0.0f, 0.0f) == DENIED && ack.result_param2 == TC_OUT_OF_RANGE, "neither arm nor disarm");
    must(pilot(ARM, NAN, 0.0f, 0.0f) == DENIED, "not a number");
    must(pilot(ARM, -1.0f, 0.0f, 0.0f) == DENIED, "negative");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "arms");
    must(pilot(ARM, 0.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_DISARMED, "disarms");
    controller.configured = false;
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == DENIED && ack.result_param2 == TC_NOT_CONFIGURED, "with the reason");
    statustext_msg text;
    SEND(PILOT, COMMAND_LONG, command_long, TO_VEHICLE, .command = ARM, .param1 = 1.0f);
    const uint8_t* payload = answer(STATUSTEXT_ID);
    must(payload != NULL, "and a sentence");
    statustext_decode(&text, payload, STATUSTEXT_LENGTH);
    must(strncmp(text.text, "arm/disarm: vehicle parameters were never set", 50) == 0, "this one");
    standard_hovering();
    must(pilot(ARM, 0.0f, 0.0f, 0.0f) == DENIED && controller.mission.state == TC_HOLD, "not in the air");
    must(pilot(ARM, 0.0f, 21197.0f, 0.0f) == DENIED && controller.mission.state == TC_HOLD, "nor with a wrong number");
    must(pilot(ARM, 0.0f, 21196.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "forced is KILL");
    standard_hovering();
    must(pilot(TERMINATE, 0.0f, 0.0f, 0.0f) == UNSUPPORTED && controller.mission.state == TC_HOLD, "nothing to undo");
    must(pilot(TERMINATE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "terminate is KILL");
}

static void take_offs(void) {
    standard_begin();
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED, "arms");
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 0.0f) == DENIED && ack.result_param2 == TC_OUT_OF_RANGE, "to no height");
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 51.0f) == DENIED, "too high");
    must(pilot(TAKE_OFF, 0.0f, 0.0f, INFINITY) == DENIED, "not finite");
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 49.0f) == DENIED && ack.result_param2 == TC_FENCE_BREACH, "beyond the fence");
    const float there[7] = {0, 0, 0, 0, 47.4f, 8.5f, 1.0f};
    must(send_long(PILOT, TAKE_OFF, there, 0) == UNSUPPORTED, "to a place on the globe");
    const float half[7] = {0, 0, 0, 0, NAN, 8.5f, 1.0f};
    must(send_long(PILOT, TAKE_OFF, half, 0) == UNSUPPORTED, "or half of one");
    must(controller.mission.state == TC_ARMED, "nothing of that was carried out");
    const float zeros[7] = {0, 0, 0, 0, 0, 0, 1.25f}; /* as pymavlink's users write it */
    must(send_long(PILOT, TAKE_OFF, zeros, 0) == ACCEPTED && controller.mission.state == TC_TAKE_OFF, "takes off");
    must(fabsf(controller.take_off_m - 1.25f) < 1e-6f, "so high above where it stood");
    standard_begin();
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED, "arms");
    must(pilot(TAKE_OFF, NAN, NAN, NAN) == ACCEPTED, "without a height, as MAVSDK does");
    must(fabsf(controller.take_off_m - TC_LINK_TAKE_OFF_M) < 1e-6f, "the documented one");
    standard_begin();
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED, "arms");
    SEND(PILOT, COMMAND_INT, command_int, TO_VEHICLE, .command = TAKE_OFF, .frame = 1, .x = INT32_MAX, .y = INT32_MAX,
         .z = 1.0f);
    must(answer(COMMAND_ACK_ID) != NULL && controller.mission.state == TC_ARMED, "z down is not understood");
    SEND(PILOT, COMMAND_INT, command_int, TO_VEHICLE, .command = TAKE_OFF, .frame = 6, .x = INT32_MAX, .y = 1,
         .z = 1.0f);
    must(answer(COMMAND_ACK_ID) != NULL && controller.mission.state == TC_ARMED, "a place as integers");
    SEND(PILOT, COMMAND_INT, command_int, TO_VEHICLE, .command = TAKE_OFF, .frame = 6, .x = INT32_MAX, .y = INT32_MAX,
         .z = 1.0f);
    must(answer(COMMAND_ACK_ID) != NULL && controller.mission.state == TC_TAKE_OFF, "a relative height is");
}

/* By another component of the pilot's system, which takes control for it. */
static bool link_command_of(uint8_t component, unsigned id) {
    const goshawk_lease_request_msg take = {TO_VEHICLE, .action = 2};
    const command_long_msg m = {TO_VEHICLE,    .command = (uint16_t)id, .param4 = NAN,
                                .param5 = NAN, .param6 = NAN,           .param7 = NAN};
    uint8_t payload[TC_PAYLOAD_MAX];
    goshawk_lease_request_encode(&take, payload);
    deliver(PILOT, component, GOSHAWK_LEASE_REQUEST_ROW, payload, GOSHAWK_LEASE_REQUEST_LENGTH);
    command_long_encode(&m, payload);
    deliver(PILOT, component, COMMAND_LONG_ROW, payload, COMMAND_LONG_LENGTH);
    return answer(COMMAND_ACK_ID) != NULL;
}

/* QGroundControl asks for the take-off and arms when that is acknowledged. */
static void take_off_before_arming(void) {
    standard_begin();
    must(mode_shown() == px4_mode(4, 3), "Hold on the ground");
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 51.0f) == DENIED, "too high: refused at once");
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED && controller.mission.state == TC_DISARMED, "remembered");
    must(mode_shown() == px4_mode(4, 2), "and shown");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_TAKE_OFF, "arming takes off");
    must(fabsf(controller.take_off_m - 2.0f) < 1e-6f, "so high");
    standard_begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    (void)go(5.1f);
    must(mode_shown() == px4_mode(4, 3), "for five seconds");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "then arming only arms");
    standard_begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    must(link_command_of(191, ARM) && controller.mission.state == TC_DISARMED, "disarming by another component");
    standard_begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    must(tc_do(&controller, TC_COMMAND_ARM, 0.0f) == TC_OK, "armed by other means");
    (void)go(0.05f);
    must(!ln.standard.take_off.waits, "takes it back");
    standard_begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    lease(OTHER, 2);
    must(command(OTHER, ARM, 1.0f, 0.0f, 0.0f, 0.0f) == ACCEPTED, "another station arms");
    must(controller.mission.state == TC_ARMED, "which did not ask for a take-off");
    for (unsigned i = 0; i < 3u; i++) {
        standard_begin();
        must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
        (void)pilot(i == 0u ? LAND : i == 1u ? REPOSITION : ARM, 0.0f, 0.0f, NAN);
        must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "taken back");
    }
    standard_begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 45.0f) == ACCEPTED, "remembered, and too high for the fence");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == DENIED && ack.result_param2 == TC_FENCE_BREACH, "which arming finds");
    must(controller.mission.state == TC_DISARMED, "and the rotors stay off");
    standard_begin();
    ln.config = &(const tc_link_config){
        .system_id = ME, .component_id = ME, .bytes_per_s = 1000000000u, .identity = TC_IDENTITY_GENERIC};
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 2.0f) == DENIED, "a generic autopilot does not wait for arming");
    must(mode_shown() == TC_DISARMED, "and shows its own states");
}

static void modes(void) {
    standard_hovering();
    must(mode_shown() == px4_mode(4, 3), "Hold");
    must(command(PILOT, MODE, 0.0f, 4.0f, 6.0f, 0.0f) == UNSUPPORTED, "not a custom mode");
    must(command(PILOT, MODE, 1.0f, 1.0f, 0.0f, 0.0f) == UNSUPPORTED, "Manual");
    must(command(PILOT, MODE, 1.0f, 4.0f, 4.0f, 0.0f) == UNSUPPORTED, "Mission: names no trajectory");
    must(command(PILOT, MODE, 1.0f, 4.0f, 5.0f, 0.0f) == UNSUPPORTED, "Return");
    must(command(PILOT, MODE, 1.0f, NAN, -1.0f, 0.0f) == UNSUPPORTED, "nothing at all");
    must(command(PILOT, MODE, 1.0f, 260.0f, 3.0f, 0.0f) == UNSUPPORTED, "not taken modulo 256");
    must(pilot(MISSION_START, 0.0f, 0.0f, 0.0f) == UNSUPPORTED, "names no trajectory");
    must(controller.mission.state == TC_HOLD, "nothing of that was carried out");
    must(command(PILOT, MODE, 1.0f, 4.0f, 2.0f, 0.0f) == DENIED, "Take-off in the air");
    must(command(PILOT, MODE, 1.0f, 4.0f, 6.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_LANDING, "Land");
    must(mode_shown() == px4_mode(4, 6), "and shows it");
    must(command(PILOT, MODE, 129.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_HOLD, "Hold");
    SEND(OTHER, SET_MODE, set_mode, .target_system = ME, .base_mode = 1, .custom_mode = px4_mode(4, 6));
    must(answer(STATUSTEXT_ID) != NULL && controller.mission.state == TC_HOLD, "not of another");
    SEND(PILOT, SET_MODE, set_mode, .target_system = ME, .base_mode = 0, .custom_mode = px4_mode(4, 6));
    must(answer(STATUSTEXT_ID) != NULL && controller.mission.state == TC_HOLD, "not custom");
    SEND(PILOT, SET_MODE, set_mode, .target_system = ME, .base_mode = 1, .custom_mode = px4_mode(4, 6));
    must(answer(HEARTBEAT_ID) != NULL && controller.mission.state == TC_LANDING, "the older message");
    standard_begin();
    must(command(PILOT, MODE, 1.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED, "Hold on the ground");
    must(controller.mission.state == TC_DISARMED, "is what it does");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && pilot(REPOSITION, -1.0f, 1.0f, NAN) == ACCEPTED, "armed, too");
    must(controller.mission.state == TC_ARMED && pilot(ARM, 0.0f, 0.0f, 0.0f) == ACCEPTED, "and stays so");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == DENIED && ack.result_param2 == TC_WRONG_STATE, "landed already");
}

static void pausing(void) {
    standard_hovering();
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_LANDING, "lands");
    const float elsewhere[7] = {0, 0, 0, 0, 47.4f, 8.5f, NAN};
    must(send_long(PILOT, LAND, elsewhere, 0) == UNSUPPORTED, "not elsewhere");
    must(send_long(PILOT, REPOSITION, elsewhere, 0) == UNSUPPORTED, "nor goes there");
    must(pilot(REPOSITION, -1.0f, 1.0f, 3.0f) == UNSUPPORTED && controller.mission.state == TC_LANDING, "nor up");
    must(pilot(REPOSITION, -1.0f, 1.0f, NAN) == ACCEPTED && controller.mission.state == TC_HOLD, "it stops");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && pilot(PAUSE, 0.0f, 0.0f, 0.0f) == ACCEPTED, "or pauses");
    must(controller.mission.state == TC_HOLD, "which is to hold, off the path");
    must(pilot(PAUSE, 1.0f, 0.0f, 0.0f) == DENIED, "nothing to continue");
    uint64_t now;
    set_out(&controller, &now, 0, TC_TRAJECTORY);
    must(mode_shown() == px4_mode(4, 4), "on the path it is Mission");
    must(pilot(PAUSE, 0.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_PAUSING, "pauses on the path");
    must(mode_shown() == px4_mode(4, 3), "Hold");
    must(pilot(PAUSE, 0.0f, 1.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_PAUSING, "once more");
    must(go(3.0f) == TC_PAUSED, "stands on the path");
    must(pilot(PAUSE, 0.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_PAUSED, "and stays on it");
    must(pilot(PAUSE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_TRAJECTORY, "goes on");
    must(command(PILOT, MODE, 1.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED, "Hold");
    must(controller.mission.state == TC_STOPPING && mode_shown() == px4_mode(4, 3),
         "leaves the path, and shows it at once");
}

static void repeats(void) {
    standard_hovering();
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_LANDING, "lands");
    must(tc_do(&controller, TC_COMMAND_HOLD, 0.0f) == TC_OK, "somebody stops it");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_HOLD,
         "the repeat is answered only");
    for (unsigned i = 0; i < 4u; i++) {
        update(751);
        lease(PILOT, 1);
    }
    const float p[7] = {0.0f, 0.0f, 0.0f, NAN, NAN, NAN, NAN};
    must(send_long(PILOT, LAND, p, 1) == ACCEPTED && controller.mission.state == TC_HOLD,
         "a counted repeat, later too");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_LANDING,
         "a new one is carried out");
    must(command(PILOT, MODE, 1.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED, "another one between");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_LANDING, "makes it new");
    must(pilot(LAND, 0.5f, 0.0f, NAN) == ACCEPTED, "other parameters are another command");
    must(pilot(REPOSITION, 0.5f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_HOLD,
         "nor another with these");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == ACCEPTED && controller.mission.state == TC_LANDING, "lands");
    must(tc_do(&controller, TC_COMMAND_HOLD, 0.0f) == TC_OK && link_command_of(191, LAND), "of another component");
    must(controller.mission.state == TC_LANDING, "it is another command");
    standard_hovering();
    const float first[7] = {0.0f, 0.0f, 0.0f, NAN, NAN, NAN, NAN};
    must(send_long(PILOT, LAND, first, 2) == ACCEPTED && controller.mission.state == TC_LANDING, "its first was lost");
    standard_hovering();
    must(pilot(TERMINATE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "KILL");
    controller.mission.state = TC_HOLD;
    must(pilot(TERMINATE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "is never held back");
    standard_begin();
    controller.configured = false;
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == DENIED, "a refused one");
    controller.configured = true;
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "may be tried again");
}

static void waiting_acknowledgements(void) {
    standard_begin();
    for (unsigned i = 0; i < TC_LINK_ACKS; i++) {
        SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = (uint16_t)(1000u + i));
    }
    SEND(PILOT, COMMAND_LONG, command_long, TO_VEHICLE, .command = ARM, .param1 = 1.0f);
    must(controller.mission.state == TC_DISARMED, "what cannot be acknowledged is not carried out");
    controller.mission.state = TC_HOLD;
    SEND(PILOT, COMMAND_LONG, command_long, TO_VEHICLE, .command = ARM, .param2 = 21196.0f);
    must(controller.mission.state == TC_FAULT, "but KILL is");
    must(ln.standard.ack_count == TC_LINK_ACKS && ln.standard.ack[ln.standard.ack_first].command == 1000u,
         "the oldest one first");
    const uint8_t* payload = answer(COMMAND_ACK_ID);
    command_ack_decode(&ack, payload, COMMAND_ACK_LENGTH);
    must(ack.command == ARM && ack.result == ACCEPTED && ln.standard.ack_count == 0u, "all of them leave");
}

static uint32_t sent_with(unsigned id) {
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = (float)id);
    return answer(id) != NULL;
}

static void requests(void) {
    standard_begin();
    static const unsigned known[] = {0, 1, 31, 32, 141, 147, 148, 242, 245, 291, 300, 331};
    for (unsigned i = 0; i < sizeof known / sizeof known[0]; i++) must(sent_with(known[i]), "sent on request");
    must(command(OTHER, REQUEST, 397.0f, 0.0f, 0.0f, 0.0f) == UNSUPPORTED, "component metadata");
    must(command(OTHER, REQUEST, NAN, 0.0f, 0.0f, 0.0f) == UNSUPPORTED, "no message");
    must(command(OTHER, REQUEST, 70000.0f, 0.0f, 0.0f, 0.0f) == UNSUPPORTED, "out of range");
    must(command(OTHER, 519, 1.0f, 0.0f, 0.0f, 0.0f) == ACCEPTED, "protocol version");
    must(command(OTHER, 520, 1.0f, 0.0f, 0.0f, 0.0f) == ACCEPTED, "capabilities");
    must(command(OTHER, 410, 0.0f, 0.0f, 0.0f, 0.0f) == ACCEPTED, "home");
    must(command(OTHER, INTERVAL, 141.0f, 10000.0f, 0.0f, 0.0f) == TEMPORARILY_REJECTED, "rates: in control only");
    must(pilot(INTERVAL, 141.0f, 4999.0f, 0.0f) == DENIED, "too often");
    must(pilot(INTERVAL, 141.0f, 61e6f, 0.0f) == DENIED, "too seldom");
    must(pilot(INTERVAL, 141.0f, NAN, 0.0f) == DENIED && pilot(INTERVAL, NAN, 1e6f, 0.0f) == DENIED, "no number");
    must(pilot(INTERVAL, -1.0f, 1e6f, 0.0f) == DENIED && pilot(INTERVAL, 1e6f, 1e6f, 0.0f) == DENIED, "no message");
    must(pilot(INTERVAL, 0.0f, -1.0f, 0.0f) == UNSUPPORTED, "the heartbeat stays");
    must(pilot(INTERVAL, 54022.0f, -1.0f, 0.0f) == UNSUPPORTED, "and the status");
    must(pilot(INTERVAL, 253.0f, 1e6f, 0.0f) == UNSUPPORTED, "not periodic");
    static const float us[] = {-1.0f, 50000.0f, 0.0f};
    static const unsigned least[] = {0, 15, 4}, most[] = {0, 21, 6};
    for (unsigned i = 0; i < 3u; i++) {
        unsigned count = 0;
        must(pilot(INTERVAL, 141.0f, us[i], 0.0f) == ACCEPTED, "an interval");
        for (unsigned k = 0; k < 100u; k++) {
            (void)go(0.01f);
            count += answer(ALTITUDE_ID) != NULL ? 1u : 0u;
        }
        must(count >= least[i] && count <= most[i], "never, twenty, five times a second");
    }
}

static void control(void) {
    start_link(false, 0);
    must(command(PILOT, CONTROL, 0.0f, 0.0f, 0.0f, 0.0f) == TEMPORARILY_REJECTED, "nothing to give back");
    must(command(PILOT, CONTROL, 0.0f, 1.0f, 1.0f, 0.0f) == ACCEPTED && ln.lease.holder.system_id == PILOT, "taken");
    must(command(OTHER, CONTROL, 0.0f, 1.0f, 1.0f, 0.0f) == TEMPORARILY_REJECTED, "not from another");
    must(command(OTHER, CONTROL, 0.0f, 0.0f, 0.0f, 0.0f) == TEMPORARILY_REJECTED, "nor given back for it");
    must(ln.lease.holder.system_id == PILOT, "it stays");
    must(command(PILOT, CONTROL, 0.0f, 1.0f, 0.0f, 0.0f) == ACCEPTED, "renewed");
    must(command(PILOT, CONTROL, 0.0f, 0.0f, 0.0f, 0.0f) == ACCEPTED && ln.lease.holder.system_id == 0u, "given back");
}

void standard_cases(void) {
    arming_and_disarming();
    take_offs();
    take_off_before_arming();
    modes();
    pausing();
    repeats();
    waiting_acknowledgements();
    requests();
    control();
}

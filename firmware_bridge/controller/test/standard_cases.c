/* Standard ground stations, one law each: what is carried out, what is refused and why, what is repeated, what the
   vehicle shows. */
#include <math.h>
#include <string.h>

#include "link_cases.h"

enum { ACCEPTED = 0, TEMPORARILY_REJECTED = 1, DENIED = 2, UNSUPPORTED = 3 };
enum { ARM = 400, TAKE_OFF = 22, LAND = 21, MODE = 176, TERMINATE = 185, REPOSITION = 192, PAUSE = 193 };
enum { INTERVAL = 511, REQUEST = 512, CONTROL = 32100, MISSION_START = 300 };

static const trouble none = {0};
static command_ack_msg ack; /* the last one */

/* Flies for a while with the link. */
static uint8_t go(float seconds) {
    static const tc_link_measured nothing = {{0}};
    uint64_t time_us = controller.telemetry.time_us;
    for (unsigned i = 0; i < (unsigned)(seconds * 100.0f); i++) {
        (void)run(&controller, &time_us, 0.0101f, &none);
        clock_us += 10000u;
        tc_link_update(&ln, &nothing, clock_us);
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

static void begin(void) {
    start_link(false, 0);
    controller.parameters.fence_max_world_m[2] = 40.0f;
    lease(PILOT, 1);
    (void)go(0.1f);
    (void)answer(0);
}

static void hovering(void) {
    begin();
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED, "arms");
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 1.0f) == ACCEPTED, "takes off");
    must(go(6.0f) == TC_HOLD, "hovers");
    (void)answer(0);
}

static uint32_t mode_shown(void) {
    heartbeat_msg m;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 0.0f);
    const uint8_t* payload = answer(HEARTBEAT_ID);
    must(payload != NULL, "a heartbeat on request");
    heartbeat_decode(&m, payload, HEARTBEAT_LENGTH);
    return m.custom_mode;
}

static uint32_t px4(uint32_t main, uint32_t sub) { return (main << 16) | (sub << 24); }

static void arming_and_disarming(void) {
    begin();
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
    hovering();
    must(pilot(ARM, 0.0f, 0.0f, 0.0f) == DENIED && controller.mission.state == TC_HOLD, "not in the air");
    must(pilot(ARM, 0.0f, 21197.0f, 0.0f) == DENIED && controller.mission.state == TC_HOLD, "nor with a wrong number");
    must(pilot(ARM, 0.0f, 21196.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "forced is KILL");
    hovering();
    must(pilot(TERMINATE, 0.0f, 0.0f, 0.0f) == UNSUPPORTED && controller.mission.state == TC_HOLD, "nothing to undo");
    must(pilot(TERMINATE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "terminate is KILL");
}

static void take_offs(void) {
    begin();
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
    begin();
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED, "arms");
    must(pilot(TAKE_OFF, NAN, NAN, NAN) == ACCEPTED, "without a height, as MAVSDK does");
    must(fabsf(controller.take_off_m - TC_LINK_TAKE_OFF_M) < 1e-6f, "the documented one");
    begin();
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
    begin();
    must(mode_shown() == px4(4, 3), "Hold on the ground");
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 51.0f) == DENIED, "too high: refused at once");
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED && controller.mission.state == TC_DISARMED, "remembered");
    must(mode_shown() == px4(4, 2), "and shown");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_TAKE_OFF, "arming takes off");
    must(fabsf(controller.take_off_m - 2.0f) < 1e-6f, "so high");
    begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    (void)go(5.1f);
    must(mode_shown() == px4(4, 3), "for five seconds");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "then arming only arms");
    begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    must(link_command_of(191, ARM) && controller.mission.state == TC_DISARMED, "disarming by another component");
    begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    must(tc_do(&controller, TC_COMMAND_ARM, 0.0f) == TC_OK, "armed by other means");
    (void)go(0.05f);
    must(!ln.standard.take_off.waits, "takes it back");
    begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
    lease(OTHER, 2);
    must(command(OTHER, ARM, 1.0f, 0.0f, 0.0f, 0.0f) == ACCEPTED, "another station arms");
    must(controller.mission.state == TC_ARMED, "which did not ask for a take-off");
    for (unsigned i = 0; i < 3u; i++) {
        begin();
        must(pilot(TAKE_OFF, -1.0f, 0.0f, 2.0f) == ACCEPTED, "remembered");
        (void)pilot(i == 0u ? LAND : i == 1u ? REPOSITION : ARM, 0.0f, 0.0f, NAN);
        must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "taken back");
    }
    begin();
    must(pilot(TAKE_OFF, -1.0f, 0.0f, 45.0f) == ACCEPTED, "remembered, and too high for the fence");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == DENIED && ack.result_param2 == TC_FENCE_BREACH, "which arming finds");
    must(controller.mission.state == TC_DISARMED, "and the rotors stay off");
    begin();
    ln.config = &(const tc_link_config){
        .system_id = ME, .component_id = ME, .bytes_per_s = 1000000000u, .identity = TC_IDENTITY_GENERIC};
    must(pilot(TAKE_OFF, 0.0f, 0.0f, 2.0f) == DENIED, "a generic autopilot does not wait for arming");
    must(mode_shown() == TC_DISARMED, "and shows its own states");
}

static void modes(void) {
    hovering();
    must(mode_shown() == px4(4, 3), "Hold");
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
    must(mode_shown() == px4(4, 6), "and shows it");
    must(command(PILOT, MODE, 129.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_HOLD, "Hold");
    SEND(OTHER, SET_MODE, set_mode, .target_system = ME, .base_mode = 1, .custom_mode = px4(4, 6));
    must(answer(STATUSTEXT_ID) != NULL && controller.mission.state == TC_HOLD, "not of another");
    SEND(PILOT, SET_MODE, set_mode, .target_system = ME, .base_mode = 0, .custom_mode = px4(4, 6));
    must(answer(STATUSTEXT_ID) != NULL && controller.mission.state == TC_HOLD, "not custom");
    SEND(PILOT, SET_MODE, set_mode, .target_system = ME, .base_mode = 1, .custom_mode = px4(4, 6));
    must(answer(HEARTBEAT_ID) != NULL && controller.mission.state == TC_LANDING, "the older message");
    begin();
    must(command(PILOT, MODE, 1.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED, "Hold on the ground");
    must(controller.mission.state == TC_DISARMED, "is what it does");
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && pilot(REPOSITION, -1.0f, 1.0f, NAN) == ACCEPTED, "armed, too");
    must(controller.mission.state == TC_ARMED && pilot(ARM, 0.0f, 0.0f, 0.0f) == ACCEPTED, "and stays so");
    must(pilot(LAND, 0.0f, 0.0f, NAN) == DENIED && ack.result_param2 == TC_WRONG_STATE, "landed already");
}

static void pausing(void) {
    hovering();
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
    must(mode_shown() == px4(4, 4), "on the path it is Mission");
    must(pilot(PAUSE, 0.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_PAUSING, "pauses on the path");
    must(mode_shown() == px4(4, 3), "Hold");
    must(pilot(PAUSE, 0.0f, 1.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_PAUSING, "once more");
    must(go(3.0f) == TC_PAUSED, "stands on the path");
    must(pilot(PAUSE, 0.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_PAUSED, "and stays on it");
    must(pilot(PAUSE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_TRAJECTORY, "goes on");
    must(command(PILOT, MODE, 1.0f, 4.0f, 3.0f, 0.0f) == ACCEPTED, "Hold");
    must(controller.mission.state == TC_STOPPING && mode_shown() == px4(4, 3), "leaves the path, and shows it at once");
}

static void repeats(void) {
    hovering();
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
    hovering();
    const float first[7] = {0.0f, 0.0f, 0.0f, NAN, NAN, NAN, NAN};
    must(send_long(PILOT, LAND, first, 2) == ACCEPTED && controller.mission.state == TC_LANDING, "its first was lost");
    hovering();
    must(pilot(TERMINATE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "KILL");
    controller.mission.state = TC_HOLD;
    must(pilot(TERMINATE, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_FAULT, "is never held back");
    begin();
    controller.configured = false;
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == DENIED, "a refused one");
    controller.configured = true;
    must(pilot(ARM, 1.0f, 0.0f, 0.0f) == ACCEPTED && controller.mission.state == TC_ARMED, "may be tried again");
}

static void waiting_acknowledgements(void) {
    begin();
    for (unsigned i = 0; i < TC_LINK_ACKS; i++) {
        SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = (uint16_t)(1000u + i));
    }
    SEND(PILOT, COMMAND_LONG, command_long, TO_VEHICLE, .command = ARM, .param1 = 1.0f);
    must(controller.mission.state == TC_DISARMED, "what cannot be acknowledged is not carried out");
    controller.mission.state = TC_HOLD;
    SEND(PILOT, COMMAND_LONG, command_long, TO_VEHICLE, .command = ARM, .param2 = 21196.0f);
    must(controller.mission.state == TC_FAULT, "but KILL is");
    must(ln.standard.ack_count == TC_LINK_ACKS && ln.standard.ack[0].command == 1000u, "the oldest one first");
    const uint8_t* payload = answer(COMMAND_ACK_ID);
    command_ack_decode(&ack, payload, COMMAND_ACK_LENGTH);
    must(ack.command == ARM && ack.result == ACCEPTED && ln.standard.ack_count == 0u, "all of them leave");
}

static uint32_t sent_with(unsigned id) {
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = (float)id);
    return answer(id) != NULL;
}

static void requests(void) {
    begin();
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

/* The value in the answer to a PARAM_SET; NaN when there is none. */
static float set_parameter(uint8_t system, const char* name, float value, uint8_t type) {
    param_set_msg m = {TO_VEHICLE, .param_value = value, .param_type = type};
    param_value_msg answered;
    uint8_t payload[TC_PAYLOAD_MAX];
    memcpy(m.param_id, name, strlen(name));
    (void)answer(0);
    param_set_encode(&m, payload);
    deliver(system, 190, PARAM_SET_ROW, payload, PARAM_SET_LENGTH);
    const uint8_t* found = answer(PARAM_VALUE_ID);
    if (found == NULL) return NAN;
    param_value_decode(&answered, found, PARAM_VALUE_LENGTH);
    must(strncmp(answered.param_id, name, 16) == 0 && answered.param_type == 9u, "the parameter that was set");
    must(answered.param_count == tc_parameters_count(), "of so many");
    return answered.param_value;
}

static void parameters(void) {
    begin();
    must(fabsf(set_parameter(PILOT, "mass_kg", 0.71f, 9) - 0.71f) < 1e-6f, "set");
    must(fabsf(tc_parameters_now(&controller)->mass_kg - 0.71f) < 1e-6f, "in force");
    must(fabsf(set_parameter(OTHER, "mass_kg", 0.9f, 9) - 0.71f) < 1e-6f, "not by another: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", -1.0f, 9) - 0.71f) < 1e-6f, "out of range: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", NAN, 9) - 0.71f) < 1e-6f, "not finite: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", 5.0f, 9) - 0.71f) < 1e-6f, "cannot hover: the old value");
    must(fabsf(set_parameter(PILOT, "mass_kg", 0.72f, 6) - 0.71f) < 1e-6f, "another type: the old value");
    must(isnan(set_parameter(PILOT, "MIS_TAKEOFF_ALT", 2.0f, 9)), "unknown: nothing to answer with");
    must(fabsf(tc_parameters_now(&controller)->mass_kg - 0.71f) < 1e-6f, "nothing of that in force");
    must(stage_parameters(PILOT, 77) == TC_OK, "a set is open");
    must(fabsf(set_parameter(PILOT, "mass_kg", 0.7f, 9) - 0.7f) < 1e-6f, "a single one goes before");
    must(commit_parameters(PILOT, 77, 0) != TC_OK, "and the set has to be opened anew");
    hovering();
    must(set_parameter(PILOT, "rotor0_x_m", 0.2f, 9) < 0.19f, "not in the air: the old value");
    SEND(PILOT, PARAM_SET, param_set, TO_VEHICLE, .param_id = "rotor0_x_m", .param_value = 0.2f, .param_type = 9);
    const uint8_t* payload = answer(STATUSTEXT_ID);
    statustext_msg text;
    must(payload != NULL, "with a sentence");
    statustext_decode(&text, payload, STATUSTEXT_LENGTH);
    must(strncmp(text.text, "rotor0_x_m: ", 12) == 0, "that names it");
}

static void missions(void) {
    begin();
    for (uint8_t type = 0; type < 4u; type++) {
        mission_count_msg m;
        SEND(OTHER, MISSION_REQUEST_LIST, mission_request_list, TO_VEHICLE, .mission_type = type);
        const uint8_t* payload = answer(MISSION_COUNT_ID);
        must((payload != NULL) == (type < 3u), "mission, fence, rally points");
        if (payload != NULL) {
            mission_count_decode(&m, payload, MISSION_COUNT_LENGTH);
            must(m.count == 0u && m.mission_type == type && m.target_system == OTHER, "none, of this type, to it");
        }
    }
    for (uint8_t type = 0; type < 3u; type++) {
        SEND(OTHER, MISSION_REQUEST_LIST, mission_request_list, TO_VEHICLE, .mission_type = type);
    }
    unsigned counts = 0;
    uint8_t frame[TC_FRAME_MAX];
    for (size_t n = 1; n != 0u;) {
        clock_us++;
        n = tc_link_transmit(&ln, frame, clock_us);
        counts += n != 0u && frame[7] == MISSION_COUNT_ID && frame[8] == 0u && frame[9] == 0u ? 1u : 0u;
    }
    must(counts == 3u, "asked at once, answered one by one");
    mission_ack_msg refused;
    SEND(OTHER, MISSION_COUNT, mission_count, TO_VEHICLE, .count = 5, .mission_type = 1);
    const uint8_t* payload = answer(MISSION_ACK_ID);
    must(payload != NULL, "a mission is refused");
    mission_ack_decode(&refused, payload, MISSION_ACK_LENGTH);
    must(refused.type == 3u && refused.mission_type == 1u && refused.target_system == OTHER, "as not supported");
}

static sys_status_msg status_now(void) {
    sys_status_msg m;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 1.0f);
    const uint8_t* payload = answer(SYS_STATUS_ID);
    must(payload != NULL, "a status on request");
    sys_status_decode(&m, payload, SYS_STATUS_LENGTH);
    return m;
}

static uint8_t landed_now(uint8_t state) {
    extended_sys_state_msg m;
    controller.mission.state = state;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 245.0f);
    const uint8_t* payload = answer(EXTENDED_SYS_STATE_ID);
    extended_sys_state_decode(&m, payload, EXTENDED_SYS_STATE_LENGTH);
    return m.landed_state;
}

#define ALL_WELL (0x1u | 0x80u | 0x200000u | 0x10000000u)

static void health(void) {
    begin();
    sys_status_msg m = status_now();
    must(m.onboard_control_sensors_health == ALL_WELL, "all is well");
    must(m.voltage_battery == UINT16_MAX, "no battery is measured");
    controller.telemetry.estimate_faults = TC_FAULT_POSITION_STALE;
    must(status_now().onboard_control_sensors_health == (0x1u | 0x200000u), "no position: no arming");
    controller.telemetry.estimate_faults = TC_FAULT_ATTITUDE_UNUSABLE;
    must(status_now().onboard_control_sensors_health == (0x1u | 0x80u), "no attitude");
    controller.telemetry.estimate_faults = TC_FAULT_RATE_STALE;
    must((status_now().onboard_control_sensors_health & 0x1u) == 0u, "no gyro");
    controller.telemetry.estimate_faults = 0;
    controller.telemetry.estimate.battery_v = 15.5f;
    controller.telemetry.estimate.valid |= TC_VALID_SPECIFIC_FORCE;
    m = status_now();
    must(m.voltage_battery == 15500u && (m.onboard_control_sensors_health & 0x2000002u) == 0x2000002u, "as measured");
    controller.telemetry.warnings = TC_WARNING_BATTERY;
    must((status_now().onboard_control_sensors_health & 0x2000000u) == 0u, "low");
    controller.telemetry.estimate.battery_v = 70.0f;
    must(status_now().voltage_battery == UINT16_MAX, "beyond what 16 bits hold");
    controller.telemetry.ticks = 0;
    must(status_now().onboard_control_sensors_health == 0u, "before the first tick nothing is known");
    begin();
    static const struct {
        uint8_t landed, main, sub;
    } shown[TC_MISSION_STATE_COUNT] = {
        [TC_DISARMED] = {1, 4, 3}, [TC_ARMED] = {1, 4, 3},      [TC_TAKE_OFF] = {3, 4, 2}, [TC_HOLD] = {2, 4, 3},
        [TC_APPROACH] = {2, 4, 4}, [TC_TRAJECTORY] = {2, 4, 4}, [TC_PAUSING] = {2, 4, 3},  [TC_PAUSED] = {2, 4, 3},
        [TC_STOPPING] = {2, 4, 3}, [TC_ABORTING] = {2, 4, 6},   [TC_LANDING] = {4, 4, 6},  [TC_EMERGENCY] = {4, 4, 6},
        [TC_FAULT] = {0, 4, 3},    [TC_SHADOW] = {0, 1, 0}};
    for (uint8_t state = 0; state < TC_MISSION_STATE_COUNT; state++) {
        must(landed_now(state) == shown[state].landed, "landed state");
        must(mode_shown() == px4(shown[state].main, shown[state].sub), "mode");
    }
}

static void heights(void) {
    hovering();
    altitude_msg m;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 141.0f);
    const uint8_t* payload = answer(ALTITUDE_ID);
    must(payload != NULL, "a height on request");
    ln.home_world_m[2] = -3.0f;
    SEND(OTHER, COMMAND_LONG, command_long, TO_VEHICLE, .command = REQUEST, .param1 = 141.0f);
    altitude_decode(&m, answer(ALTITUDE_ID), ALTITUDE_LENGTH);
    must(fabsf(m.altitude_local - 1.0f) < 0.01f, "world z");
    must(fabsf(m.altitude_relative - 4.0f) < 0.01f && fabsf(m.altitude_amsl - 4.0f) < 0.01f, "above where it stood");
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
    parameters();
    missions();
    health();
    heights();
}

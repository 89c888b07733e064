/* Standard ground stations: what QGroundControl, MAVSDK and pymavlink ask for in MAVLink's common set, carried out as
   our own orders. What cannot be carried out is refused with its reason; nothing is half done.
   docs/how-to/standard_stations.md has the table of commands. */
#include <math.h>
#include <string.h>

#include "../../base/maths.h"
#include "services.h"

/* MAV_CMD */
enum {
    CMD_LAND = 21,
    CMD_TAKE_OFF = 22,
    CMD_SET_MODE = 176,
    CMD_TERMINATE = 185,
    CMD_REPOSITION = 192,
    CMD_PAUSE_CONTINUE = 193,
    CMD_ARM_DISARM = 400,
    CMD_GET_HOME = 410,
    CMD_MESSAGE_INTERVAL = 511,
    CMD_REQUEST_MESSAGE = 512,
    CMD_REQUEST_PROTOCOL = 519,
    CMD_REQUEST_CAPABILITIES = 520,
    CMD_OPERATOR_CONTROL = 32100
};

/* MAV_RESULT */
enum { RESULT_ACCEPTED = 0, RESULT_TEMPORARILY_REJECTED = 1, RESULT_DENIED = 2, RESULT_UNSUPPORTED = 3 };

/* MAV_FRAME whose third coordinate is a height upwards */
enum { FRAME_GLOBAL = 0, FRAME_GLOBAL_RELATIVE = 3, FRAME_GLOBAL_INT = 5, FRAME_GLOBAL_RELATIVE_INT = 6 };

enum { MISSION_UNSUPPORTED = 3 };               /* MAV_MISSION_RESULT */
enum { MISSION_TYPES = 3 };                     /* mission, fence, rally points */
static const float FORCED = 21196.0f;           /* second parameter of CMD_ARM_DISARM */
static const uint32_t REPEAT_US = 3000000u;     /* stations repeat a command that was not acknowledged for about 2 s */
static const uint32_t ARM_WITHIN_US = 5000000u; /* of a take-off that was asked for before arming */
static const float SHORTEST_INTERVAL_US = 5000.0f; /* 200 Hz */
static const float LONGEST_INTERVAL_US = 60e6f;    /* a minute */

/* A COMMAND_LONG or COMMAND_INT. */
typedef struct {
    uint16_t id;
    uint8_t confirmation; /* 0 at first; else it is a repeat */
    uint8_t frame;
    float parameter[7]; /* NaN where there is none */
} command;

/* -- orders ----------------------------------------------------------------------------------------------------- */

static bool on_ground(const tc_link* link) {
    const uint8_t state = link->controller->mission.state;
    return state == (uint8_t)TC_DISARMED || state == (uint8_t)TC_ARMED;
}

static void forget_take_off(tc_link* link) { link->standard.take_off.waits = false; }

/* To a height above where it stands; NaN takes TC_LINK_TAKE_OFF_M. Under PX4's identity a vehicle that is not armed
   remembers it, and takes off when the same station arms it within ARM_WITHIN_US. */
static uint8_t take_off(tc_link* link, tc_link_station from, float height_m) {
    const float asked_m = isnan(height_m) ? TC_LINK_TAKE_OFF_M : height_m;
    if (!(asked_m >= TC_LOWEST_TAKE_OFF_M && asked_m <= TC_HIGHEST_TAKE_OFF_M)) {
        return TC_OUT_OF_RANGE;
    }
    const bool disarmed = link->controller->mission.state == (uint8_t)TC_DISARMED;
    if (!disarmed || link->config->identity != TC_IDENTITY_PX4) {
        return link_do(link, TC_COMMAND_TAKE_OFF, asked_m);
    }
    link->standard.take_off.waits = true;
    link->standard.take_off.from = from;
    link->standard.take_off.height_m = asked_m;
    link->standard.take_off.until_us = link->clock_us + ARM_WITHIN_US;
    return TC_OK;
}

static uint8_t arm(tc_link* link, tc_link_station from) {
    const tc_link_take_off waiting = link->standard.take_off;
    const bool takes_off = waiting.waits && link_same_station(waiting.from, from);
    forget_take_off(link);
    uint8_t reason = link_do(link, TC_COMMAND_ARM, 0.0f);
    if (reason == (uint8_t)TC_OK && takes_off) {
        reason = link_do(link, TC_COMMAND_TAKE_OFF, waiting.height_m);
        if (reason != (uint8_t)TC_OK) {
            (void)link_do(link, TC_COMMAND_DISARM, 0.0f);
        }
    }
    return reason;
}

static bool is_forced(const command* c) { return tc_abs(c->parameter[1] - FORCED) < 0.5f; }

/* Forced disarming is KILL; the arming check cannot be skipped. */
static uint8_t arm_or_disarm(tc_link* link, tc_link_station from, const command* c) {
    if (c->parameter[0] >= 0.5f && c->parameter[0] <= 1.5f) {
        return is_forced(c) ? (uint8_t)TC_LINK_UNSUPPORTED : arm(link, from);
    }
    if (!(c->parameter[0] >= -0.5f && c->parameter[0] < 0.5f)) {
        return TC_OUT_OF_RANGE;
    }
    forget_take_off(link);
    return link_do(link, is_forced(c) ? TC_COMMAND_KILL : TC_COMMAND_DISARM, 0.0f);
}

/* On the ground Hold is what it does. */
static uint8_t hold(tc_link* link) {
    forget_take_off(link);
    return on_ground(link) ? (uint8_t)TC_OK : link_do(link, TC_COMMAND_HOLD, 0.0f);
}

static uint8_t land(tc_link* link) {
    forget_take_off(link);
    return link_do(link, TC_COMMAND_LAND, 0.0f);
}

/* A trajectory is started by its id and CRC (GOSHAWK_COMMAND_START): a mode or a MISSION_START names neither. */
static uint8_t set_px4_mode(tc_link* link, tc_link_station from, uint32_t main, uint32_t sub) {
    if (main != (uint32_t)PX4_AUTO) {
        return TC_LINK_UNSUPPORTED;
    }
    switch (sub) {
        case AUTO_TAKE_OFF:
            return take_off(link, from, NAN);
        case AUTO_HOLD:
            return hold(link);
        case AUTO_LAND:
            return land(link);
        default:
            return TC_LINK_UNSUPPORTED;
    }
}

static uint32_t small_number(float x) { return x >= 0.0f && x <= 255.0f ? (uint32_t)x : 255u; }

static uint8_t set_mode(tc_link* link, tc_link_station from, const command* c) {
    const bool custom = (small_number(c->parameter[0]) & MODE_CUSTOM) != 0u;
    return custom ? set_px4_mode(link, from, small_number(c->parameter[1]), small_number(c->parameter[2]))
                  : (uint8_t)TC_LINK_UNSUPPORTED;
}

/* Latitude and longitude mean nothing here: nobody may believe that they were heeded. */
static bool names_a_place(const command* c) {
    const bool first = isnan(c->parameter[4]) || tc_abs(c->parameter[4]) <= 0.0f;
    const bool second = isnan(c->parameter[5]) || tc_abs(c->parameter[5]) <= 0.0f;
    return !(first && second);
}

static uint8_t take_off_to(tc_link* link, tc_link_station from, const command* c) {
    switch (c->frame) {
        case FRAME_GLOBAL:
        case FRAME_GLOBAL_RELATIVE:
        case FRAME_GLOBAL_INT:
        case FRAME_GLOBAL_RELATIVE_INT:
            return names_a_place(c) ? (uint8_t)TC_LINK_UNSUPPORTED : take_off(link, from, c->parameter[6]);
        default:
            return TC_LINK_UNSUPPORTED;
    }
}

/* Without a place it is QGroundControl's way to stop. */
static uint8_t reposition(tc_link* link, const command* c) {
    const bool elsewhere = names_a_place(c) || !isnan(c->parameter[6]);
    return elsewhere ? (uint8_t)TC_LINK_UNSUPPORTED : hold(link);
}

static uint8_t pause_or_continue(tc_link* link, const command* c) {
    const uint8_t state = link->controller->mission.state;
    if (c->parameter[0] >= 0.5f) {
        return link_do(link, TC_COMMAND_RESUME, 0.0f);
    }
    const bool on_path = state == (uint8_t)TC_TRAJECTORY || state == (uint8_t)TC_PAUSING || state == (uint8_t)TC_PAUSED;
    return on_path ? link_do(link, TC_COMMAND_PAUSE, 0.0f) : hold(link);
}

/* Microseconds; 0 as it was at the start, negative never. */
static uint8_t set_interval(tc_link* link, const command* c) {
    const float interval_us = c->parameter[1];
    const float id = c->parameter[0];
    uint32_t period_us = TC_LINK_NEVER;
    if (!(id >= 0.0f && id <= 65535.0f) || isnan(interval_us)) {
        return TC_OUT_OF_RANGE;
    }
    if (interval_us >= 0.0f) {
        const bool preset = interval_us < 1.0f;
        if (!preset && (interval_us < SHORTEST_INTERVAL_US || interval_us > LONGEST_INTERVAL_US)) {
            return TC_OUT_OF_RANGE;
        }
        period_us = preset ? TC_LINK_PRESET : (uint32_t)interval_us;
    }
    return link_set_period(link, (uint32_t)id, period_us) ? (uint8_t)TC_OK : (uint8_t)TC_LINK_UNSUPPORTED;
}

/* Orders: of the station in control only. */
static uint8_t carry_out(tc_link* link, tc_link_station from, const command* c) {
    switch (c->id) {
        case CMD_ARM_DISARM:
            return arm_or_disarm(link, from, c);
        case CMD_TAKE_OFF:
            return take_off_to(link, from, c);
        case CMD_LAND:
            return names_a_place(c) ? (uint8_t)TC_LINK_UNSUPPORTED : land(link);
        case CMD_SET_MODE:
            return set_mode(link, from, c);
        case CMD_REPOSITION:
            return reposition(link, c);
        case CMD_PAUSE_CONTINUE:
            return pause_or_continue(link, c);
        case CMD_TERMINATE:
            return c->parameter[0] >= 0.5f ? link_do(link, TC_COMMAND_KILL, 0.0f) : (uint8_t)TC_LINK_UNSUPPORTED;
        case CMD_MESSAGE_INTERVAL:
            return set_interval(link, c);
        default:
            return TC_LINK_UNSUPPORTED;
    }
}

/* -- commands --------------------------------------------------------------------------------------------------- */

static const char* name_of(uint16_t id) {
    switch (id) {
        case CMD_ARM_DISARM:
            return "arm/disarm";
        case CMD_TAKE_OFF:
            return "take-off";
        case CMD_LAND:
            return "land";
        case CMD_SET_MODE:
            return "mode";
        case CMD_REPOSITION:
        case CMD_PAUSE_CONTINUE:
            return "pause";
        case CMD_TERMINATE:
            return "terminate";
        default:
            return NULL; /* what a station tries by itself, without its pilot */
    }
}

/* Requests that change nothing, of any station; false when it is none. */
static bool answer_request(tc_link* link, const command* c, uint8_t* reason) {
    const float id = c->parameter[0];
    *reason = TC_OK;
    switch (c->id) {
        case CMD_REQUEST_MESSAGE:
            if (!(id >= 0.0f && id <= 65535.0f) || !link_send_by_id(link, (uint32_t)id)) {
                *reason = TC_LINK_UNSUPPORTED;
            }
            return true;
        case CMD_REQUEST_CAPABILITIES:
            link_send(link, LINK_OUT_VERSION);
            return true;
        case CMD_REQUEST_PROTOCOL:
            link_send(link, LINK_OUT_PROTOCOL);
            return true;
        case CMD_GET_HOME:
            link_send(link, LINK_OUT_HOME);
            return true;
        default:
            return false;
    }
}

/* MAVLink's own request for control (second parameter: 1 take or renew, 0 give back). Never by force. It names no
   session: such a station is known by its stream. */
static uint8_t operator_control(tc_link* link, const link_message* message, const command* c) {
    if (c->parameter[1] >= 0.5f) {
        return link_take_lease(link, message->from, 0u, false) ? (uint8_t)TC_OK : (uint8_t)TC_LINK_NOT_IN_CONTROL;
    }
    if (!message->in_control) {
        return TC_LINK_NOT_IN_CONTROL;
    }
    link_release_lease(link);
    return TC_OK;
}

/* Whether this very command was carried out a moment ago: then its acknowledgement was lost. MAVSDK does not count its
   repeats in `confirmation`; where one is counted, it is a repeat however late. */
static bool is_repeat(const tc_link* link, tc_link_station from, const command* c) {
    const tc_link_done* done = &link->standard.done;
    return done->valid && link_same_station(done->from, from) && done->command == c->id &&
           memcmp(done->parameter, c->parameter, sizeof c->parameter) == 0 &&
           (c->confirmation != 0u || link->clock_us - done->at_us < REPEAT_US);
}

static bool is_kill(const command* c) {
    return c->id == (uint16_t)CMD_TERMINATE || (c->id == (uint16_t)CMD_ARM_DISARM && is_forced(c));
}

static uint8_t obey(tc_link* link, const link_message* message, const command* c) {
    if (!message->in_control) {
        return TC_LINK_NOT_IN_CONTROL;
    }
    if (is_repeat(link, message->from, c) && !is_kill(c)) {
        return TC_OK;
    }
    const uint8_t reason = carry_out(link, message->from, c);
    tc_link_done* done = &link->standard.done;
    done->valid = reason == (uint8_t)TC_OK; /* a refused one may be tried again */
    done->from = message->from;
    done->command = c->id;
    done->at_us = link->clock_us;
    memcpy(done->parameter, c->parameter, sizeof done->parameter);
    link_send(link, LINK_OUT_HEARTBEAT); /* which carries the mode that stations wait for */
    return reason;
}

static uint8_t result_of(uint8_t reason) {
    switch (reason) {
        case TC_OK:
            return RESULT_ACCEPTED;
        case TC_LINK_NOT_IN_CONTROL:
            return RESULT_TEMPORARILY_REJECTED;
        case TC_LINK_UNSUPPORTED:
            return RESULT_UNSUPPORTED;
        default:
            return RESULT_DENIED;
    }
}

/* What cannot be acknowledged is not carried out, but for KILL: the station repeats it. */
static void receive_command(tc_link* link, const link_message* message, const command* c) {
    tc_link_standard* s = &link->standard;
    uint8_t reason = TC_OK;
    if (s->ack_count == TC_LINK_ACKS) {
        if (!is_kill(c)) {
            return;
        }
        s->ack_count--;
    }
    if (c->id == (uint16_t)CMD_OPERATOR_CONTROL) {
        reason = operator_control(link, message, c);
    } else if (!answer_request(link, c, &reason)) {
        reason = obey(link, message, c);
        if (reason != (uint8_t)TC_OK && name_of(c->id) != NULL) {
            link_report_refusal(link, name_of(c->id), reason);
        }
    } else {
        /* answered */
    }
    const tc_link_ack ack = {message->from, c->id, result_of(reason), reason};
    s->ack[(s->ack_first + s->ack_count) % TC_LINK_ACKS] = ack;
    s->ack_count++;
    link_send(link, LINK_OUT_COMMAND_ACK);
}

void link_receive_command_long(tc_link* link, const link_message* message) {
    command_long_msg m;
    command_long_decode(&m, message->payload, message->length);
    const command c = {m.command,
                       m.confirmation,
                       FRAME_GLOBAL_RELATIVE,
                       {m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7}};
    receive_command(link, message, &c);
}

static float coordinate(int32_t x) { return x == INT32_MAX ? NAN : (float)x; }

void link_receive_command_int(tc_link* link, const link_message* message) {
    command_int_msg m;
    command_int_decode(&m, message->payload, message->length);
    const command c = {
        m.command, 0u, m.frame, {m.param1, m.param2, m.param3, m.param4, coordinate(m.x), coordinate(m.y), m.z}};
    receive_command(link, message, &c);
}

/* Not acknowledged: the heartbeat shows the mode. */
void link_receive_set_mode(tc_link* link, const link_message* message) {
    set_mode_msg m;
    set_mode_decode(&m, message->payload, message->length);
    uint8_t reason = TC_LINK_NOT_IN_CONTROL;
    if (message->in_control) {
        const bool custom = (m.base_mode & MODE_CUSTOM) != 0u;
        reason = custom ? set_px4_mode(link, message->from, (m.custom_mode >> 16) & 0xFFu, m.custom_mode >> 24)
                        : (uint8_t)TC_LINK_UNSUPPORTED;
        link_send(link, LINK_OUT_HEARTBEAT);
    }
    if (reason != (uint8_t)TC_OK) {
        link_report_refusal(link, "mode", reason);
    }
}

link_encoded link_encode_command_ack(tc_link* link, uint8_t* payload) {
    tc_link_standard* s = &link->standard;
    if (s->ack_count == 0u) {
        return LINK_NOTHING;
    }
    const tc_link_ack ack = s->ack[s->ack_first];
    const command_ack_msg m = {.command = ack.command,
                               .result = ack.result,
                               .result_param2 = ack.reason,
                               .target_system = ack.to.system_id,
                               .target_component = ack.to.component_id};
    s->ack_first = (uint8_t)((s->ack_first + 1u) % TC_LINK_ACKS);
    s->ack_count--;
    command_ack_encode(&m, payload);
    return LINK_MORE;
}

/* -- missions: there are none ----------------------------------------------------------------------------------- */

void link_receive_mission_request_list(tc_link* link, const link_message* message) {
    mission_request_list_msg m;
    mission_request_list_decode(&m, message->payload, message->length);
    if (m.mission_type < MISSION_TYPES) {
        link->standard.mission_to = message->from;
        link->standard.mission_lists = (uint8_t)(link->standard.mission_lists | (1u << m.mission_type));
        link_send(link, LINK_OUT_MISSION_COUNT);
    }
}

link_encoded link_encode_mission_count(tc_link* link, uint8_t* payload) {
    tc_link_standard* s = &link->standard;
    for (unsigned type = 0; type < MISSION_TYPES; type++) {
        if ((s->mission_lists & (1u << type)) != 0u) {
            const mission_count_msg m = {.target_system = s->mission_to.system_id,
                                         .target_component = s->mission_to.component_id,
                                         .mission_type = (uint8_t)type};
            s->mission_lists = (uint8_t)(s->mission_lists & ~(1u << type));
            mission_count_encode(&m, payload);
            return LINK_MORE;
        }
    }
    return LINK_NOTHING;
}

/* A station that wants to send one. */
void link_receive_mission_count(tc_link* link, const link_message* message) {
    mission_count_msg m;
    mission_count_decode(&m, message->payload, message->length);
    link->standard.mission_to = message->from;
    link->standard.mission_refused = m.mission_type;
    link_send(link, LINK_OUT_MISSION_ACK);
}

link_encoded link_encode_mission_ack(tc_link* link, uint8_t* payload) {
    const mission_ack_msg m = {.target_system = link->standard.mission_to.system_id,
                               .target_component = link->standard.mission_to.component_id,
                               .type = MISSION_UNSUPPORTED,
                               .mission_type = link->standard.mission_refused};
    mission_ack_encode(&m, payload);
    return LINK_ENCODED;
}

/* -- time ------------------------------------------------------------------------------------------------------- */

void link_standard_update(tc_link* link) {
    const tc_link_take_off* wanted = &link->standard.take_off;
    const bool disarmed = link->controller->mission.state == (uint8_t)TC_DISARMED;
    if (wanted->waits && (!disarmed || link->clock_us >= wanted->until_us)) {
        forget_take_off(link);
        link_send(link, LINK_OUT_HEARTBEAT);
    }
}

/* What the files of the link share. Internal.

   link.c                 time, leases, orders, dispatch of what was received, the update after each tick
   transport/frame.c      frames, found and built
   transport/signing.c    who signs, what is new
   transport/admission.c  who gets in: address, signature, budget, challenge
   transport/transmit.c   the table of outgoing messages, when they are due, the byte rate
   services/telemetry.c   messages about the vehicle
   services/log.c         the on-board log
   services/upload.c      a trajectory into the staged slot
   services/reading.c     pieces of the active trajectory and of the log on request
   services/parameter_protocol.c
   services/standard.c    standard ground stations: commands, missions
   services/presentation.c  what they are shown: identity, mode, health, heights

   To add a message to what the vehicle receives: a function link_receive_... and a case in link.c's dispatch. To what
   it sends: a place in the list below and a row in transmit.c with the function that encodes it. */
#ifndef LINK_INTERNAL_H
#define LINK_INTERNAL_H

#include "goshawk_controller/link.h"
#include "goshawk_dialect.h"

/* A message that was let in. A handler decodes it by the generated decoder of its kind:
   timesync_decode(&m, message->payload, message->length). */
typedef struct {
    const uint8_t* payload;
    size_t length;
    uint8_t row; /* of the dialect's table */
    tc_link_station from;
    bool in_control; /* its sender */
} link_message;

/* What the link may have to send, bits of `pending`, the most urgent first: answers, then telemetry, then bulk. */
typedef enum {
    LINK_OUT_ORDER_RESULT,
    LINK_OUT_FOREIGN_RESULT,
    LINK_OUT_LEASE,
    LINK_OUT_CHALLENGE,
    LINK_OUT_TIMESYNC,
    LINK_OUT_COMMAND_ACK,
    LINK_OUT_COMMIT_RESULT,
    LINK_OUT_UPLOAD_REFUSED,
    LINK_OUT_UPLOAD_STATUS,
    LINK_OUT_HEARTBEAT,
    LINK_OUT_MISSION_STATUS,
    LINK_OUT_STATE,
    LINK_OUT_TEXT,
    LINK_OUT_MISSION_COUNT,
    LINK_OUT_MISSION_ACK,
    LINK_OUT_PARAMETER_SET,
    LINK_OUT_PROTOCOL,
    LINK_OUT_SYS_STATUS,
    LINK_OUT_EXTENDED_STATE,
    LINK_OUT_VERSION,
    LINK_OUT_HOME,
    LINK_OUT_ATTITUDE,
    LINK_OUT_POSITION,
    LINK_OUT_ALTITUDE,
    LINK_OUT_ROTORS,
    LINK_OUT_BATTERY,
    LINK_OUT_ODOMETRY,
    LINK_OUT_PARAMETERS_RESULT,
    LINK_OUT_PARAMETER,
    LINK_OUT_TRAJECTORY_HEADER,
    LINK_OUT_TRAJECTORY_SEGMENT,
    LINK_OUT_LOG_INFO,
    LINK_OUT_LOG_RECORD,
    LINK_OUT_COUNT
} link_out;

/* What an encoder has done with the payload. */
typedef enum {
    LINK_NOTHING, /* there was nothing to send after all */
    LINK_ENCODED,
    LINK_MORE /* encoded one, and there is another: stays pending */
} link_encoded;

/* Makes a message pending. */
void link_send(tc_link* link, link_out what);
void link_cancel(tc_link* link, link_out what);

/* link.c. The caller's clock, without its steps: to be called first by everything that is handed a time. */
void link_set_clock(tc_link* link, uint64_t now_us);
/* Carries a frame out that was let in. */
void link_dispatch(tc_link* link, const tc_frame* frame);
bool link_is_holder(const tc_link* link, tc_link_station station);
/* Takes control, or keeps it: by force, or if it is free or the station's already. Whether it has control now. */
bool link_take_lease(tc_link* link, tc_link_station station, bool by_force);
void link_release_lease(tc_link* link);

typedef struct {
    uint32_t request_id; /* not 0 */
    uint8_t command;     /* GOSHAWK_COMMAND */
    float value;
    uint32_t trajectory_id, crc32; /* for START */
} link_order;

/* tc_do for the station in control. In shadow nothing, not even KILL: the vehicle is not ours to stop. */
uint8_t link_do(tc_link* link, tc_command command, float value);
/* An order of a station: refused unless it is in control; under a request id that it has used last it is not carried
   out again, and the first answer holds. */
const tc_link_order_result* link_execute_order(tc_link* link, const link_message* from, const link_order* order);

/* admission.c */
void link_admission_init(tc_link* link);
void link_receive_frame(tc_link* link, const tc_frame* frame);
/* Checks the frame that was chosen among those without budget. */
void link_draw_lottery(tc_link* link);
link_encoded link_encode_challenge(tc_link* link, uint8_t* payload);

/* frame.c. A row of the dialect's table, of which there is to be one copy. */
const goshawk_dialect_row* link_row(unsigned message);

/* transmit.c. Whether one of a series is due, and when the next one will be. */
bool link_is_due(uint64_t* next_us, uint64_t now_us, uint32_t period_us);
/* Makes what is due by the vehicle's clock pending. */
void link_schedule_vehicle(tc_link* link);
/* Has GOSHAWK_MISSION_STATUS sent with the next frames. */
void link_hurry_status(tc_link* link);
/* By the number of a message: has it sent; sets how often it is sent (with those of its series), TC_LINK_PRESET or
   TC_LINK_NEVER. False where it is not one that is sent periodically. */
bool link_send_by_id(tc_link* link, uint32_t id);
bool link_set_period(tc_link* link, uint32_t id, uint32_t period_us);

/* telemetry.c */
void link_fill_state(const tc_link* link, goshawk_state_msg* m);
void link_note_changes(tc_link* link); /* has texts sent about what changed */
link_encoded link_encode_mission_status(tc_link* link, uint8_t* payload);
link_encoded link_encode_state(tc_link* link, uint8_t* payload);
link_encoded link_encode_text(tc_link* link, uint8_t* payload);
link_encoded link_encode_home(tc_link* link, uint8_t* payload);
link_encoded link_encode_attitude(tc_link* link, uint8_t* payload);
link_encoded link_encode_position(tc_link* link, uint8_t* payload);
link_encoded link_encode_rotors(tc_link* link, uint8_t* payload);
link_encoded link_encode_battery(tc_link* link, uint8_t* payload);
link_encoded link_encode_odometry(tc_link* link, uint8_t* payload);

/* log.c */
uint8_t link_log_start(tc_link* link, uint32_t id);
void link_log_stop(tc_link* link);
void link_log_update(tc_link* link);
link_encoded link_encode_log_info(tc_link* link, uint8_t* payload);

/* upload.c */
void link_receive_begin(tc_link* link, const link_message* message);
void link_receive_segment(tc_link* link, const link_message* message);
void link_receive_samples(tc_link* link, const link_message* message);
void link_receive_commit(tc_link* link, const link_message* message);
void link_upload_update(tc_link* link);   /* a slice of a commit */
void link_upload_schedule(tc_link* link); /* repeats the report while pieces are missing */
link_encoded link_encode_upload_status(tc_link* link, uint8_t* payload);
link_encoded link_encode_upload_refused(tc_link* link, uint8_t* payload);
link_encoded link_encode_commit_result(tc_link* link, uint8_t* payload);

/* reading.c */
void link_receive_trajectory_read(tc_link* link, const link_message* message);
void link_receive_log_request(tc_link* link, const link_message* message);
link_encoded link_encode_trajectory_header(tc_link* link, uint8_t* payload);
link_encoded link_encode_trajectory_segment(tc_link* link, uint8_t* payload);
link_encoded link_encode_log_record(tc_link* link, uint8_t* payload);

/* parameter_protocol.c */
void link_receive_parameters_stage(tc_link* link, const link_message* message);
void link_receive_parameters_commit(tc_link* link, const link_message* message);
void link_receive_parameter_request(tc_link* link, const link_message* message);
/* Has the parameters from `first` up to `end` sent. */
void link_send_parameters(tc_link* link, uint16_t first, uint16_t end);
link_encoded link_encode_parameters_result(tc_link* link, uint8_t* payload);
link_encoded link_encode_parameter(tc_link* link, uint8_t* payload);
void link_receive_parameter_set(tc_link* link, const link_message* message);
link_encoded link_encode_parameter_set(tc_link* link, uint8_t* payload);

/* PX4's modes, as heartbeats carry them and as stations ask for them: main mode in byte 2, sub mode in byte 3. */
enum { PX4_MANUAL = 1, PX4_AUTO = 4 };
enum { AUTO_TAKE_OFF = 2, AUTO_HOLD = 3, AUTO_MISSION = 4, AUTO_LAND = 6 };

/* standard.c */
void link_receive_command_long(tc_link* link, const link_message* message);
void link_receive_command_int(tc_link* link, const link_message* message);
void link_receive_set_mode(tc_link* link, const link_message* message);
void link_receive_mission_request_list(tc_link* link, const link_message* message);
void link_receive_mission_count(tc_link* link, const link_message* message);
void link_standard_update(tc_link* link); /* forgets a take-off that nobody armed for */
const char* link_reason_text(uint8_t reason);
/* Has the pilot told what was refused, and why. */
void link_report_refusal(tc_link* link, const char* what, uint8_t reason);
link_encoded link_encode_command_ack(tc_link* link, uint8_t* payload);
link_encoded link_encode_mission_count(tc_link* link, uint8_t* payload);
link_encoded link_encode_mission_ack(tc_link* link, uint8_t* payload);

/* presentation.c */
link_encoded link_encode_heartbeat(tc_link* link, uint8_t* payload);
link_encoded link_encode_version(tc_link* link, uint8_t* payload);
link_encoded link_encode_protocol(tc_link* link, uint8_t* payload);
link_encoded link_encode_sys_status(tc_link* link, uint8_t* payload);
link_encoded link_encode_extended_state(tc_link* link, uint8_t* payload);
link_encoded link_encode_altitude(tc_link* link, uint8_t* payload);

#endif

/* What messages say: a handler for each that is received, an encoder for each that is sent. Internal.

   session.c             requests for control, challenges, time
   orders.c              orders of our own dialect
   standard.c            standard ground stations: commands, missions
   presentation.c        what they are shown: identity, mode, health, heights
   telemetry.c           messages about the vehicle
   texts.c               sentences for the pilot
   log.c                 the on-board log
   upload.c              a trajectory into the staged slot
   reading.c             pieces of the active trajectory and of the log on request
   parameter_protocol.c  parameters, one by one and as a set

   To add a message that is received: its XML, its handler, and its row in LINK_RECEIVED below. One that is sent: its
   XML, its encoder, declared here, a row in the table of ../messages.c and a place in transport.h's list. */
#ifndef LINK_SERVICES_H
#define LINK_SERVICES_H

#include "../transport/transport.h"

/* A message that was let in. A handler decodes it by the generated decoder of its kind:
   timesync_decode(&m, message->payload, message->length). */
typedef struct {
    const uint8_t* payload;
    size_t length;
    tc_link_station from;
    bool in_control; /* its sender */
} link_message;

/* What an encoder has done with the payload. */
typedef enum {
    LINK_NOTHING, /* there was nothing to send after all */
    LINK_ENCODED,
    LINK_MORE /* encoded one, and there is another: stays pending */
} link_encoded;

/* What is received: rows of the dialect, each with its handler, which is declared here and called by ../messages.c. */
#define LINK_RECEIVED(HANDLER)                                             \
    HANDLER(GOSHAWK_LEASE_REQUEST_ROW, link_receive_lease_request)         \
    HANDLER(GOSHAWK_MISSION_COMMAND_ROW, link_receive_mission_command)     \
    HANDLER(GOSHAWK_TRAJECTORY_BEGIN_ROW, link_receive_begin)              \
    HANDLER(GOSHAWK_TRAJECTORY_SEGMENT_ROW, link_receive_segment)          \
    HANDLER(GOSHAWK_TRAJECTORY_SAMPLES_ROW, link_receive_samples)          \
    HANDLER(GOSHAWK_TRAJECTORY_COMMIT_ROW, link_receive_commit)            \
    HANDLER(GOSHAWK_TRAJECTORY_READ_ROW, link_receive_trajectory_read)     \
    HANDLER(GOSHAWK_PARAMETERS_STAGE_ROW, link_receive_parameters_stage)   \
    HANDLER(GOSHAWK_PARAMETERS_COMMIT_ROW, link_receive_parameters_commit) \
    HANDLER(PARAM_REQUEST_READ_ROW, link_receive_parameter_request)        \
    HANDLER(PARAM_REQUEST_LIST_ROW, link_receive_parameter_list)           \
    HANDLER(GOSHAWK_LOG_REQUEST_ROW, link_receive_log_request)             \
    HANDLER(COMMAND_LONG_ROW, link_receive_command_long)                   \
    HANDLER(COMMAND_INT_ROW, link_receive_command_int)                     \
    HANDLER(SET_MODE_ROW, link_receive_set_mode)                           \
    HANDLER(PARAM_SET_ROW, link_receive_parameter_set)                     \
    HANDLER(MISSION_REQUEST_LIST_ROW, link_receive_mission_request_list)   \
    HANDLER(MISSION_COUNT_ROW, link_receive_mission_count)                 \
    HANDLER(TIMESYNC_ROW, link_receive_timesync)
#define LINK_DECLARED(row, handle) void handle(tc_link* link, const link_message* message);
LINK_RECEIVED(LINK_DECLARED)

/* session.c */
link_encoded link_encode_lease(tc_link* link, uint8_t* payload);
link_encoded link_encode_challenge(tc_link* link, uint8_t* payload);
link_encoded link_encode_timesync(tc_link* link, uint8_t* payload);

/* orders.c */
/* tc_do for the station in control. In shadow nothing, not even KILL: the vehicle is not ours to stop. */
uint8_t link_do(tc_link* link, tc_command command, float value);
link_encoded link_encode_order_result(tc_link* link, uint8_t* payload);
link_encoded link_encode_foreign_result(tc_link* link, uint8_t* payload);

/* telemetry.c */
void link_fill_state(const tc_link* link, goshawk_state_msg* m);
link_encoded link_encode_mission_status(tc_link* link, uint8_t* payload);
link_encoded link_encode_state(tc_link* link, uint8_t* payload);
link_encoded link_encode_home(tc_link* link, uint8_t* payload);
link_encoded link_encode_attitude(tc_link* link, uint8_t* payload);
link_encoded link_encode_position(tc_link* link, uint8_t* payload);
link_encoded link_encode_rotors(tc_link* link, uint8_t* payload);
uint16_t link_battery_mv(const tc_link* link); /* UINT16_MAX where it is not known */
link_encoded link_encode_battery(tc_link* link, uint8_t* payload);
link_encoded link_encode_odometry(tc_link* link, uint8_t* payload);

/* log.c */
uint8_t link_log_start(tc_link* link, uint32_t id);
void link_log_stop(tc_link* link);
void link_log_update(tc_link* link);
link_encoded link_encode_log_info(tc_link* link, uint8_t* payload);

/* upload.c */
void link_upload_update(tc_link* link);   /* a slice of a commit */
void link_upload_schedule(tc_link* link); /* repeats the report while pieces are missing */
link_encoded link_encode_upload_status(tc_link* link, uint8_t* payload);
link_encoded link_encode_upload_refused(tc_link* link, uint8_t* payload);
link_encoded link_encode_commit_result(tc_link* link, uint8_t* payload);

/* reading.c */
link_encoded link_encode_trajectory_header(tc_link* link, uint8_t* payload);
link_encoded link_encode_trajectory_segment(tc_link* link, uint8_t* payload);
link_encoded link_encode_log_record(tc_link* link, uint8_t* payload);

/* parameter_protocol.c */
link_encoded link_encode_parameters_result(tc_link* link, uint8_t* payload);
link_encoded link_encode_parameter(tc_link* link, uint8_t* payload);
link_encoded link_encode_parameter_set(tc_link* link, uint8_t* payload);

static const uint32_t MODE_CUSTOM = 1u; /* MAV_MODE_FLAG: the mode is the autopilot's own, as follows */
/* PX4's modes, as heartbeats carry them and as stations ask for them: main mode in byte 2, sub mode in byte 3. */
enum { PX4_MANUAL = 1, PX4_AUTO = 4 };
enum { AUTO_TAKE_OFF = 2, AUTO_HOLD = 3, AUTO_MISSION = 4, AUTO_LAND = 6 };

/* standard.c */
void link_standard_update(tc_link* link); /* forgets a take-off that nobody armed for */
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

/* texts.c */
void link_note_changes(tc_link* link); /* has texts sent about what changed */
/* Has the pilot told what was refused, and why. */
void link_report_refusal(tc_link* link, const char* what, uint8_t reason);
link_encoded link_encode_text(tc_link* link, uint8_t* payload);

#endif

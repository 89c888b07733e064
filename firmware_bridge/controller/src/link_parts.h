/* What the files of the link share. Not for users. */
#ifndef LINK_PARTS_H
#define LINK_PARTS_H

#include "copy.h"
#include "goshawk_controller/link.h"
#include "goshawk_dialect.h"
#include "maths.h"

/* GOSHAWK_TRAJECTORY_SEGMENT without its coefficients, GOSHAWK_TRAJECTORY_READ without its bits, and
   GOSHAWK_TRAJECTORY_BEGIN without what only names it. */
typedef struct {
    uint32_t transfer_id, duration_us;
    uint16_t index;
} link_segment_head;

typedef struct {
    uint32_t transfer_id;
    uint16_t first;
} link_read_head;

typedef struct {
    uint32_t transfer_id, trajectory_id, crc32;
    uint16_t segments;
    uint8_t target[2];
    uint8_t coefficient_count, link_loss_policy, samples;
} link_begin_head;

/* The beginning of a payload, as the message that it is of; the long ones, whose numbers begin in the same way, are
   read on from the frame. What was cut off at its end is zero. */
typedef union {
    uint32_t id; /* of the transfer, the order, the request: the first number of each of our messages */
    goshawk_lease_request_msg lease;
    goshawk_mission_command_msg order;
    goshawk_trajectory_commit_msg commit;
    goshawk_parameters_commit_msg parameters;
    link_segment_head segment;
    link_read_head read;
    link_begin_head begin;
    param_request_read_msg parameter;
    timesync_msg timesync;
} link_head;

/* A message that came in, and when. */
typedef struct {
    tc_frame frame;
    link_head head;
    uint32_t now_us;
    bool in_control; /* its sender */
} link_message;

/* What the link may have to say, bits of `due`; the most urgent first: answers, then telemetry, then bulk. */
enum {
    SAY_ORDER,
    SAY_FOREIGN,
    SAY_LEASE,
    SAY_TIMESYNC,
    SAY_ACKNOWLEDGED,
    SAY_COMMIT,
    SAY_REFUSED,
    SAY_UPLOAD,
    SAY_HEARTBEAT,
    SAY_MISSION,
    SAY_STATE,
    SAY_TEXT,
    SAY_VERSION,
    SAY_HOME,
    SAY_ATTITUDE,
    SAY_POSITION,
    SAY_ROTORS,
    SAY_BATTERY,
    SAY_ODOMETRY,
    SAY_SET,
    SAY_VALUE, /* this one and those below that are asked for by the dozen stay due until there are no more */
    SAY_HEADER,
    SAY_SEGMENT,
    SAY_LOG,
    SAY_RECORD,
    SAYINGS
};

#define DUE(what) ((uint32_t)1u << (uint32_t)(what))

/* The series: what is due again and again. First those of the vehicle's clock, then those of the link's. */
enum {
    SERIES_STATE,
    SERIES_POSE,
    SERIES_ODOMETRY,
    SERIES_SLOW,
    SERIES_HEARTBEAT, /* the first one of the link's clock */
    SERIES_MISSION,
    SERIES_VERSION
};

/* The moments. */
enum {
    HEARD,      /* the station in control */
    LAST_FRAME, /* of the upload */
    LAST_STATUS
};

/* Receivers: one per message that asks for something. */
void link_on_begin(tc_link* link, const link_message* message);
void link_on_segment(tc_link* link, const link_message* message);
void link_on_samples(tc_link* link, const link_message* message);
void link_on_commit(tc_link* link, const link_message* message);
/* Ends an upload that was refused or has fallen silent, so that parameters may have its memory. */
void link_give_way(tc_link* link, uint32_t now_us);
void link_on_parameters_stage(tc_link* link, const link_message* message);
void link_on_parameters_commit(tc_link* link, const link_message* message);
void link_on_parameter_request(tc_link* link, const link_message* message);
void link_on_parameter_list(tc_link* link, uint16_t first, uint16_t count);
/* A request for pieces of the trajectory or of the log. */
void link_on_read(tc_link* link, const link_message* message);
void link_on_log_request(tc_link* link, const link_message* message);

/* Senders: fill a payload that is zero, apart from what lies ready; false when there is nothing more to say. */
void link_say_bitmap(const tc_link* link, uint8_t* payload);
void link_say_header(const tc_link* link, uint8_t* payload);
bool link_say_segment(tc_link* link, uint8_t* payload);
bool link_say_value(tc_link* link, uint8_t* payload);
bool link_say_record(tc_link* link, uint8_t* payload);
void link_say_telemetry(const tc_link* link, unsigned what, uint8_t* payload);

/* NULL when there is none. */
const tc_trajectory* link_active(const tc_link* link);
/* The signs of three numbers as MAVLink's (tc_copy_bytes): NED from world, FRD from body, a half turn about x. */
#define LINK_FLIPPED 0x880u
/* The next piece that was asked for and exists, there being `count`; `count` when there is none. */
uint32_t link_take(tc_link* link, uint32_t count);

/* Log and telemetry. */
uint8_t link_log_start(tc_link* link, uint32_t id);
void link_telemetry_update(tc_link* link, const tc_link_measured* measured);
/* Makes due what belongs to the series from `first` up to `end`. */
void link_series(tc_link* link, unsigned first, unsigned end, uint32_t now_us);
/* Whether one of a series is due now, and when the next one will be. A late one is not made up for. */
bool link_due(uint32_t* next_us, uint32_t now_us, uint32_t period_us);
/* Time over a unit of at most 65536. 32 bits at a time: a division of 64 would take 700 bytes of the C library. */
uint64_t link_quotient(uint64_t time, uint32_t unit);

#endif

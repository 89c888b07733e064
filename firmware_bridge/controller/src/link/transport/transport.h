/* What carries messages, whatever they say: clock, frames, who gets in, who is in control, what is to be sent.
   Internal.

   frame.c      frames, found and built
   signing.c    who signs, what is new
   lease.c      which station is in control
   admission.c  who gets in: address, signature, budget, challenge
   transmit.c   what is pending, when the periodic messages are due, the byte rate */
#ifndef LINK_TRANSPORT_H
#define LINK_TRANSPORT_H

#include "goshawk_controller/link.h"
#include "goshawk_dialect.h"

/* What the link may have to send, bits of `pending`: answers, the most urgent first; telemetry, in turns; bulk. */
typedef enum {
    LINK_OUT_ORDER_RESULT,
    LINK_OUT_FOREIGN_RESULT,
    LINK_OUT_LEASE,
    LINK_OUT_CHALLENGE,
    LINK_OUT_TIMESYNC,
    LINK_OUT_COMMAND_ACK,
    LINK_OUT_COMMIT_RESULT,
    LINK_OUT_UPLOAD_REFUSED,
    LINK_OUT_HEARTBEAT,
    LINK_OUT_TEXT,
    LINK_OUT_MISSION_STATUS, /* telemetry from here */
    LINK_OUT_STATE,
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
    LINK_OUT_UPLOAD_STATUS, /* bulk from here */
    LINK_OUT_PARAMETERS_RESULT,
    LINK_OUT_PARAMETER,
    LINK_OUT_TRAJECTORY_HEADER,
    LINK_OUT_TRAJECTORY_SEGMENT,
    LINK_OUT_LOG_INFO,
    LINK_OUT_LOG_RECORD,
    LINK_OUT_COUNT
} link_out;

enum { LINK_TELEMETRY = LINK_OUT_MISSION_STATUS, LINK_BULK = LINK_OUT_UPLOAD_STATUS }; /* where they begin */

/* lease.c */
static inline bool link_same_station(tc_link_station a, tc_link_station b) {
    return a.system_id == b.system_id && a.component_id == b.component_id && a.link_id == b.link_id;
}
/* Who sent a frame. */
tc_link_station link_sender(const tc_frame* frame);
/* Whether somebody is in control over this stream; whether it is this session. */
bool link_is_holder_stream(const tc_link* link, tc_link_station station);
bool link_is_holder(const tc_link* link, tc_link_station station, uint32_t session);
/* Takes control, or keeps it: by force, or if it is free or the session's already. Whether it has control now. */
bool link_take_lease(tc_link* link, tc_link_station station, uint32_t session, bool by_force);
void link_release_lease(tc_link* link);
void link_expire_lease(tc_link* link);
/* The operator was received. The controller learns it before the order that comes along. */
void link_note_operator(tc_link* link);
/* Tells the controller for how long the operator has been silent: in the vehicle's time as long as in the link's. */
void link_lease_update(tc_link* link);

/* admission.c */
void link_admission_init(tc_link* link);
/* Whether the frame may be carried out. One that found no budget may be drawn later. */
bool link_admit(tc_link* link, const tc_frame* frame);
/* Checks one of the frames without budget; NULL when there is none that may be carried out. */
const tc_frame* link_draw_lottery(tc_link* link);

/* frame.c. A row of the dialect's table, of which there is to be one copy. */
const goshawk_dialect_row* link_row(unsigned message);

/* transmit.c. The caller's clock, without its steps: to be called first by everything that is handed a time. */
void link_set_clock(tc_link* link, uint64_t now_us);
/* Makes a message pending. */
void link_send(tc_link* link, link_out what);
void link_cancel(tc_link* link, link_out what);
static inline bool link_is_pending(const tc_link* link, link_out what) {
    return ((link->pending >> (unsigned)what) & 1u) != 0u;
}
/* Whether one of a series is due, and when the next one will be. */
bool link_is_due(uint64_t* next_us, uint64_t now_us, uint32_t period_us);
/* Makes pending what is due by the vehicle's clock, and by the link's. */
void link_schedule_vehicle(tc_link* link);
void link_schedule_link(tc_link* link);
/* Has GOSHAWK_MISSION_STATUS sent with the next frames. */
void link_hurry_status(tc_link* link);
/* By the number of a message: has it sent; sets how often it is sent (with those of its series), TC_LINK_PRESET or
   TC_LINK_NEVER. False where it is not one that is sent periodically. */
bool link_send_by_id(tc_link* link, uint32_t id);
bool link_set_period(tc_link* link, uint32_t id, uint32_t period_us);
/* Notes what the line carries, in bytes per second; 0: no limit is known. */
void link_set_line(tc_link* link, uint32_t bytes_per_s);
/* What may be sent: the configured rate, or less where the line carries less; never 0. */
uint32_t link_bytes_per_s(const tc_link* link);
/* Whether telemetry makes way for a challenge; whether bulk goes before telemetry; what was sent, and how long it was.
 */
bool link_is_quiet(const tc_link* link);
bool link_bulk_first(const tc_link* link);
void link_account(tc_link* link, link_out what, size_t n);
/* Earns what the byte rate gives since the last time; whether anything may be sent. */
bool link_may_send(tc_link* link);
/* `by` is below 65,536: long division in base 65,536, which spares the flash 0.7 kB of the C library's. */
uint64_t link_divide(uint64_t number, uint32_t by);
/* The frame around a payload that stands in it already; its length, which is taken off the byte rate. */
size_t link_send_frame(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint8_t row);

#endif

/* The link: the ground's side door to the controller. Datagrams (or a byte stream) in, frames out; MAVLink 2, signed.

       tc_link link;                                            // yours
       tc_link_init(&link, &controller, &config, now_us);       // after tc_init; log memory and key are in config
       tc_link_receive(&link, bytes, n, NULL, now_us);          // whatever came in
       tc_link_update(&link, &measured, now_us);                // once after every tc_tick
       while ((n = tc_link_transmit(&link, frame, now_us)) > 0) send(frame, n);

   What it promises:
   - Only frames signed with the key, each once and none older than 0.65 s beside its stream, have any effect
   (heartbeats may be unsigned: they only make the vehicle heard). Refused ones are counted.
   - One station at a time is in control (a lease it renews); the others may watch and read.
   - An upload fills the staged slot piece by piece, reports a bitmap of what arrived, and is committed by transfer, id
   and CRC. Lost, doubled, swapped or damaged pieces, and restarts, leave either the whole new plan or the whole old
   one.
   - An order carried out once is not carried out again when its frame is repeated.
   - Nothing blocks: answers wait in their own places, at most one of each kind, and leave as the byte rate allows.

   `now_us` is the clock of the link (leases, repeats, pacing). It is the controller's clock on a vehicle; a simulation
   that does not run at the pace of the wall clock hands in the wall clock here. */
#ifndef GOSHAWK_CONTROLLER_LINK_H
#define GOSHAWK_CONTROLLER_LINK_H

#include "goshawk_controller/controller.h"
#include "goshawk_controller/link_codec.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TC_LINK_RECORD 156u       /* bytes of a log record: the payload of a GOSHAWK_STATE */
#define TC_LINK_LEASE_US 3000000u /* control ends this long after the last renewal */
#define TC_LINK_GROUP 48u         /* parameters per frame */
#define TC_LINK_WANTED 64u        /* bytes of bits in a request for pieces */

/* Reasons of the link itself; the values below 70 are tc_reason. Part of the protocol: only append. */
enum {
    TC_LINK_NOT_IN_CONTROL = 70,
    TC_LINK_UNSUPPORTED = 71,
    TC_LINK_OTHER_TRAJECTORY = 72,
    TC_LINK_NO_LOG_MEMORY = 73,
    TC_LINK_SAMPLES_MISSING = 74
};

typedef struct {
    uint8_t system_id, component_id;
    bool sign;                 /* false: accept and send unsigned frames; for the bench only */
    uint8_t key[TC_KEY_BYTES]; /* shared with the ground stations */
    uint64_t start_10us;       /* signature clock at the start: real time if there is one, else the last value kept */
    uint32_t boot_id;          /* differs from start to start */
    uint32_t bytes_per_s;      /* the link's share that the vehicle may use */
    uint8_t* log;              /* memory of the on-board log, or NULL */
    uint32_t log_records;      /* how many records of TC_LINK_RECORD bytes fit */
    uint32_t log_period_us;    /* controller time between records */
} tc_link_config;

/* What the controller does not know but a flight log wants. */
typedef struct {
    float specific_force_body_m_s2[3];
    float rotor_speed_rad_s[TC_ROTORS];
} tc_link_measured;

typedef struct {
    uint32_t accepted;          /* frames that passed everything */
    uint32_t without_signature; /* heartbeats not counted */
    uint32_t wrong_key;
    uint32_t replayed;
    uint32_t not_for_us; /* other target, or own system id */
    uint32_t sent;
    tc_frame_faults faults; /* what was no frame at all */
} tc_link_counts;

/* The answers of the link wait in these places as they are sent: each lies as the payload of its message. */
typedef struct {
    uint32_t request_id;
    uint8_t command, reason, mission_state;
} tc_link_order; /* GOSHAWK_MISSION_RESULT */

typedef struct {
    uint32_t nonce, left_ms;
    uint8_t system_id, component_id; /* 0, 0: nobody is in control */
} tc_link_lease;                     /* GOSHAWK_LEASE_STATUS */

typedef struct {
    int64_t vehicle_ns, asker_ns;
} tc_link_timesync; /* TIMESYNC */

typedef struct {
    uint16_t command; /* MAV_CMD */
    uint8_t result;
} tc_link_acknowledged; /* COMMAND_ACK */

typedef struct {
    uint32_t transfer_id; /* 0: none open; else it fills the staged slot */
    uint32_t frames;
    uint16_t received, segments, last_index;
    uint8_t reason;
    uint8_t has_samples;
} tc_link_upload; /* GOSHAWK_TRAJECTORY_STATUS, the bitmap left out */

typedef struct {
    uint32_t transfer_id, active_id, active_crc32;
    uint16_t segment;
    uint8_t reason;
} tc_link_commit; /* GOSHAWK_TRAJECTORY_RESULT */

typedef struct {
    uint32_t transfer_id, active_crc32;
    uint16_t index;
    uint8_t groups, committed, reason;
} tc_link_set; /* GOSHAWK_PARAMETERS_RESULT */

typedef struct {
    uint32_t id, records, capacity, not_stored, period_us;
    uint8_t running;
} tc_link_log; /* GOSHAWK_LOG_INFO */

enum { TC_LINK_SERIES = 7, TC_LINK_MOMENTS = 3 };

/* What is used most comes first, where short instructions reach it. Times of 32 bits are low words, and wrap after 71
   minutes. None comes alive again by that: a series that is not ahead of the clock by at most its period is due
   (link_due); tc_link_update ends a lease in time, and keeps moments from getting older than half of that. */
typedef struct {
    const tc_link_config* config;
    tc_controller* controller;
    uint32_t due; /* bits: what is to be said */
    tc_link_lease lease;
    tc_link_upload upload;
    uint16_t wanted_next;           /* bits before this one are done */
    uint16_t value_next, value_end; /* PARAM_VALUEs to send */
    uint16_t state_sequence;
    uint32_t until_us;                   /* end of the lease */
    uint32_t moment_us[TC_LINK_MOMENTS]; /* when something was last */
    tc_link_set set;
    uint32_t set_done_id;
    tc_link_commit commit; /* the last one, answered again when it is repeated */
    uint32_t wanted_first; /* pieces of the trajectory or of the log: the newest request, whoever asked before */
    tc_link_counts counts;
    int64_t budget_byte_us; /* bytes that may be sent now, times a million */
    uint32_t budget_us;
    uint32_t due_us[TC_LINK_SERIES]; /* when the next one of a series is */
    uint64_t started_us;
    tc_link_timesync timesync;
    tc_link_log log;
    uint32_t log_due_us;
    tc_link_order order;       /* of the station in control, answered again when it is repeated */
    tc_link_order foreign;     /* of one that is not */
    tc_link_upload refused;    /* somebody asked to begin and may not */
    uint32_t read_transfer_id; /* of the trajectory's reader */
    uint32_t state_period_us;  /* 0: never */
    uint32_t transitions;      /* of the mission, when last told */
    float home_world_m[3];     /* where it last stood */
    tc_link_measured measured; /* at the last tick */
    tc_link_acknowledged acknowledged;
    uint8_t order_from[2]; /* system and component that gave the order */
    uint8_t samples_wanted;
    uint8_t sequence;
    bool heard;                     /* ever, the station in control */
    uint8_t wanted[TC_LINK_WANTED]; /* bit i: piece wanted_first + i */
    tc_signing signing;
} tc_link;

/* `config` stays the caller's, and stays where it is. */
void tc_link_init(tc_link* link, tc_controller* controller, const tc_link_config* config, uint64_t now_us);

/* Takes bytes from the radio: a datagram of whole frames, which are read where they lie; or, with a `stream`, a piece
   of a byte stream, which may end in the middle of a frame. Every serial port has its own `stream`. */
void tc_link_receive(tc_link* link, const uint8_t* bytes, size_t n, tc_parser* stream, uint64_t now_us);

/* Once after every tick: notes what is to be told, writes the log, tells the controller how long the operator is
 * silent. */
void tc_link_update(tc_link* link, const tc_link_measured* measured, uint64_t now_us);

/* The next frame to send, or 0 when there is nothing to say or the byte rate is used up. */
size_t tc_link_transmit(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint64_t now_us);

/* Brings a trajectory kept over a restart back through all checks into the active slot. */
tc_reason tc_link_restore(tc_link* link, const tc_trajectory* kept);

#ifdef __cplusplus
}
#endif

#endif

/* The link: the ground's side door to the controller. Datagrams (or a byte stream) in, frames out; MAVLink 2, signed.

       tc_link link;                                            // yours
       tc_link_init(&link, &controller, &config, now_us);       // after tc_init; log memory and key are in config
       tc_link_receive(&link, bytes, n, NULL, now_us);          // whatever came in
       tc_link_update(&link, &measured, now_us);                // once after every tc_tick
       while ((n = tc_link_transmit(&link, frame, now_us)) > 0) send(frame, n);

   What it promises:
   - Only frames signed with the key, each newer than the last of its stream, have any effect (heartbeats may be
   unsigned: they only make the vehicle heard). Refused ones are counted.
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
    float rotor_speed_rad_s[TC_ROTORS];
    float specific_force_body_m_s2[3];
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

/* Pieces somebody asked for and has not been sent yet. */
typedef struct {
    uint32_t first;
    uint16_t next;                /* bits before this one are done */
    uint8_t bits[TC_LINK_WANTED]; /* bit i: piece first + i */
} tc_link_wanted;

/* In each part the widest members come first: no memory is lost to gaps. */
typedef struct {
    const tc_link_config* config;
    tc_controller* controller;
    tc_signing signing;
    uint64_t started_us, budget_us;
    int64_t budget_bytes; /* may be sent now */
    int64_t timesync_ts1;
    tc_link_counts counts;

    struct {
        uint64_t until_us, heard_us;
        uint32_t nonce;
        uint8_t system_id, component_id; /* 0, 0: nobody */
        bool answer;
    } lease;

    struct {
        uint64_t last_frame_us, last_status_us;
        uint32_t transfer_id; /* 0: none open; else it fills the staged slot */
        uint32_t frames;
        uint32_t refused_transfer_id; /* somebody asked to begin and may not */
        uint16_t received, last_index;
        uint8_t samples_wanted, reason;
        uint8_t refused_reason;
        bool samples, answer;
    } upload;

    struct {
        uint32_t transfer_id; /* of the last commit, answered again when it is repeated */
        uint16_t segment;
        uint8_t reason;
        bool answer;
    } commit;

    /* Pieces of the trajectory or of the log: one request at a time, the newest. Whoever asked before asks again. */
    struct {
        uint32_t transfer_id; /* of the trajectory's reader */
        tc_link_wanted wanted;
        bool log; /* wanted of the log */
        bool header;
    } read;

    struct {
        uint32_t request_id;
        uint32_t foreign_id; /* order of a station that is not in control */
        uint8_t foreign_command;
        uint8_t system_id, component_id, command, reason;
        bool answer;
    } order;

    struct {
        uint32_t transfer_id, done_id;
        uint16_t index;
        uint16_t next, end; /* PARAM_VALUEs to send */
        uint8_t groups, reason;
        bool committed, answer;
    } parameters;

    struct {
        uint64_t due_us;
        uint32_t id, records, not_stored;
        bool running, info;
    } log;

    struct {
        uint64_t state_due_us, standard_due_us, slow_due_us, heartbeat_us, status_us, version_us;
        uint32_t state_period_us;  /* 0: never */
        uint32_t transitions;      /* of the mission, when last told */
        tc_link_measured measured; /* at the last tick */
        float home_world_m[3];     /* where it last stood */
        uint16_t state_sequence;
        uint8_t standard; /* bits: which standard messages are due */
        bool state_ready, version, home, text;
    } telemetry;

    uint16_t command_long; /* MAV_CMD to acknowledge */
    uint8_t command_long_result;
    uint8_t sequence;
    bool timesync, command_ack;
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

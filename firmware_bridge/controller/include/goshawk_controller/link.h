/* The link: what the ground says to the controller and what it learns of it. Datagrams (or a byte stream) in, frames
   out; MAVLink 2, signed.

       tc_link link;                                            // yours
       tc_link_init(&link, &controller, &config, now_us);       // after tc_init; log memory and key are in config
       tc_link_receive(&link, bytes, n, NULL, now_us);          // whatever came in
       tc_link_update(&link, now_us);                           // once after every tc_tick
       while ((n = tc_link_transmit(&link, frame, now_us)) > 0) send(frame, n);

   Who gets in
   - Only frames signed with the key have any effect, each once. A station's stream opens by a challenge: the vehicle
     sends a PING that holds 96 unpredictable bits of this boot, the station returns it signed (MAVSDK and
   QGroundControl do so by themselves), and the stamp of that answer is the stream's floor. So nothing recorded earlier
   can come back, whatever the clocks say. What is refused is counted.
   - One station at a time is in control (a lease it renews, known by the session it drew at its start, never by its
     id); the others may watch and read.
   - An upload fills the staged slot piece by piece, reports a bitmap of what arrived, and is committed by transfer, id
     and CRC. Lost, doubled, swapped or damaged pieces, and restarts, leave either the whole new plan or the whole old
     one. Parameters gather in memory of their own and take effect by a commit, all or none.
   - An order carried out once is not carried out again when its frame is repeated.
   - Nothing blocks: answers wait in their own places, at most one of each kind, and leave as the byte rate allows.
     That is `bytes_per_s`, or less where the operator has measured that the line carries less. Bulk (read-back, log,
     parameters, reports of an upload) and telemetry each have their share of it; telemetry takes turns.

   Bounds. Address, stream and time stamp are looked at before any hash is computed. Signatures are checked at
   `signature_checks_per_s` for frames that claim to be of the station in control and at a quarter of that for all
   others, each with a reserve of TC_LINK_RESERVE_US: frames that claim other senders cannot use the share of the
   station in control. Of the frames that find no budget left one is kept and checked at the next tc_link_update, chosen
   at random with equal chances. So where n forged frames claim to be of the station in control between two updates,
   each of its own frames is still checked with a probability of at least 1 / (n + 1), independently of their order and
   timing, and KILL sent again and again gets through. A commit is checked in slices of TC_SEGMENTS_PER_CALL
   segments, one an update unless `commit_slices` says otherwise.

   Clock. `now_us` is the clock of the link (leases, repeats, pacing). It is the controller's clock on a vehicle; a
   simulation that does not run at the pace of the wall clock hands in the wall clock here. A clock that steps back
   counts as standing, one that leaps by more than TC_LINK_LONGEST_STEP_US as having gone on by that. */
#ifndef GOSHAWK_CONTROLLER_LINK_H
#define GOSHAWK_CONTROLLER_LINK_H

#include "goshawk_controller/controller.h"
#include "goshawk_controller/link_codec.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TC_LINK_RECORD 227u       /* bytes of a log record: the payload of a GOSHAWK_STATE */
#define TC_LINK_LEASE_US 3000000u /* control ends this long after the last renewal */
#define TC_LINK_GROUP 48u         /* parameters per frame */
#define TC_LINK_WANTED 64u        /* bytes of bits in a request for pieces */
#define TC_LINK_NAME 24u          /* characters of a station's name */
#define TC_LINK_LONGEST_STEP_US 1000000u
#define TC_LINK_CHECKS_PER_S 2000u   /* signature checks where the configuration says 0 */
#define TC_LINK_RESERVE_US 4000u     /* how much of that rate may be saved up */
#define TC_LINK_CHALLENGE_US 100000u /* at most one challenge in this time */
#define TC_LINK_ANSWER_US 10000000u  /* an older challenge is no longer answered */
#define TC_LINK_QUIET_US 500000u     /* so long telemetry makes way for a challenge, on the ground */
#define TC_LINK_LEAST_RATE 200u      /* bytes/s: less is not believed of a line */
#define TC_LINK_KEEP_PERIOD_S 60u    /* keep the stamp at least this often (tc_link_stamp_to_keep) */
#define TC_LINK_PERIODS 9u           /* how many series of telemetry there are */

#define TC_LINK_TAKE_OFF_M 1.5f /* of a standard take-off that names no height */
#define TC_LINK_ACKS 8u         /* acknowledgements of standard commands that may wait */
#define TC_LINK_PRESET 0u       /* as a period of a message: as it was at the start */
#define TC_LINK_NEVER UINT32_MAX

/* How the vehicle introduces itself to standard ground stations (docs/how-to/standard_stations.md). PX4: with its
   modes, so that QGroundControl offers arm, take-off, hold and land. Generic: as what it is, with the mission state as
   its mode; then QGroundControl shows the vehicle, and offers no buttons. */
typedef enum { TC_IDENTITY_PX4 = 0, TC_IDENTITY_GENERIC = 1 } tc_link_identity;

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
    tc_link_identity identity;
    bool sign;                 /* false: accept and send unsigned frames; for the bench only */
    uint8_t key[TC_KEY_BYTES]; /* shared with the ground stations */
    /* Where the vehicle's own time stamps start, in units of 10 microseconds since 2015-01-01 00:00 UTC: the kept value
       (tc_link_stamp_to_keep), or real time if there is a clock and it is later. Stations refuse stamps that go back.
       A vehicle that has lost the value takes it from the first station that it hears. */
    uint64_t start_10us;
    /* A number that no other boot of this vehicle has had: a counter in permanent memory, one write a boot. The
       challenges follow from it: one that repeats lets recordings of that boot in. */
    uint32_t boot_id;
    uint32_t signature_checks_per_s; /* for the station in control; 0: TC_LINK_CHECKS_PER_S */
    uint32_t commit_slices;          /* of a commit in one update; 0: one, of TC_SEGMENTS_PER_CALL segments */
    uint32_t bytes_per_s;            /* the link's share that the vehicle may use */
    uint8_t* log;                    /* memory of the on-board log, or NULL */
    uint32_t log_records;            /* how many records of TC_LINK_RECORD bytes fit */
    uint32_t log_period_us;          /* controller time between records */
} tc_link_config;

typedef struct {
    uint32_t accepted;          /* frames that passed everything */
    uint32_t without_signature; /* heartbeats not counted */
    uint32_t wrong_key;
    uint32_t replayed;
    uint32_t unopened;    /* signed, of a stream that has not answered a challenge */
    uint32_t over_budget; /* never checked, because too many came */
    uint32_t not_for_us;  /* other target, or own system id */
    uint32_t sent;
    tc_frame_faults faults; /* what was no frame at all */
} tc_link_counts;

/* A stream of frames. Two stations may have the same ids; signed ones still differ in link id, as each start of a
   station draws its own. */
typedef struct {
    uint8_t system_id, component_id; /* 0, 0: nobody */
    uint8_t link_id;                 /* of its signatures; 0 unsigned */
} tc_link_station;

/* The operator is a session: a number that a station draws at random when it starts. All orders of our dialect carry
   it. A standard station has none (0) and is known by its stream. */
typedef struct {
    uint64_t until_us;
    uint64_t heard_us; /* the last frame of a holder */
    uint32_t session;
    uint32_t nonce; /* of the request that is to be answered */
    tc_link_station holder;
    bool names_holder;       /* whether the answer to come does */
    bool ever_heard;         /* a holder, since the start */
    char name[TC_LINK_NAME]; /* for people */
} tc_link_lease;

typedef struct {
    tc_link_station from;
    uint32_t request_id;
    uint8_t command, reason, mission_state;
} tc_link_order_result;

typedef struct {
    int64_t vehicle_ns, asker_ns;
} tc_link_timesync;

typedef struct {
    tc_link_station to;
    uint16_t command; /* MAV_CMD */
    uint8_t result;   /* MAV_RESULT */
    uint8_t reason;
} tc_link_ack;

/* The standard command carried out last: its repeat is acknowledged and not carried out again. */
typedef struct {
    bool valid;
    tc_link_station from;
    uint16_t command;
    float parameter[7];
    uint64_t at_us;
} tc_link_done;

/* A take-off asked for before arming, as QGroundControl does. */
typedef struct {
    bool waits;
    tc_link_station from;
    float height_m;
    uint64_t until_us;
} tc_link_take_off;

typedef struct {
    const char* what; /* NULL: nothing to report */
    uint8_t reason;
} tc_link_refused_order;

/* What standard ground stations asked for (standard.c). */
typedef struct {
    tc_link_ack ack[TC_LINK_ACKS]; /* a ring: so many from the first one on wait */
    uint8_t ack_first, ack_count;
    tc_link_done done;
    tc_link_take_off take_off;
    tc_link_refused_order refusal;
    uint16_t parameter; /* the one that a station has set */
    tc_link_station mission_to;
    uint8_t mission_lists;   /* bit i: asked for the list of MAV_MISSION_TYPE i */
    uint8_t mission_refused; /* MAV_MISSION_TYPE of what a station wants to send */
} tc_link_standard;

typedef struct {
    uint32_t transfer_id; /* 0: none is open; else it fills the staged slot */
    uint32_t session;     /* of the station that opened it */
    uint32_t frames;
    uint16_t received, last_index;
    uint8_t samples_wanted;
    bool has_samples;
    bool checking;  /* a commit is being worked on */
    uint8_t reason; /* why a piece was refused */
    uint64_t last_frame_us, last_status_us;
} tc_link_upload;

typedef struct {
    uint32_t transfer_id;
    uint16_t segment;
    uint8_t reason;
} tc_link_commit;

typedef struct {
    uint32_t transfer_id;
    uint8_t reason;
} tc_link_refusal;

typedef struct {
    uint32_t transfer_id;
    uint32_t done_id; /* the set committed last: a late piece of it opens nothing */
    uint16_t index;   /* of the parameter that was refused */
    uint8_t groups;   /* bit i: group i has arrived */
    bool committed;
    uint8_t reason;
    tc_parameters staged;
} tc_link_set;

/* Pieces of the trajectory or of the log that were asked for: the newest request, whoever asked before. */
typedef struct {
    uint32_t first, next;           /* bits before `next` are done */
    uint8_t wanted[TC_LINK_WANTED]; /* bit i: piece first + i */
    uint32_t transfer_id;           /* of the trajectory's reader */
    uint16_t value_next, value_end; /* PARAM_VALUEs to send */
} tc_link_reading;

typedef struct {
    uint32_t id, records, not_stored;
    bool running;
    uint64_t next_us;
} tc_link_log;

typedef struct {
    uint64_t time_usec; /* the PING's fields */
    uint32_t seq;
    uint32_t counter;
    uint64_t issued_us;
    uint64_t next_us;  /* not sent again before */
    uint64_t quiet_us; /* until then telemetry makes way for it */
} tc_link_challenge;

/* What the operator measured that the line carries, for as long as it reports it. */
typedef struct {
    uint32_t bytes_per_s;
    uint64_t until_us;
} tc_link_line;

/* Spends at a rate: free again at `next_us` minus the reserve. */
typedef struct {
    uint64_t next_us;
} tc_link_budget;

/* The one of `candidates` frames without budget that the next update checks. */
typedef struct {
    uint8_t bytes[TC_FRAME_MAX];
    tc_frame frame;
    uint32_t candidates;
} tc_link_lottery;

/* A text for the pilot that is being sent: "subject: text", in chunks of 50 characters. */
typedef struct {
    const char *subject, *text;
    uint8_t severity; /* MAV_SEVERITY */
    uint8_t chunk;
    uint16_t id;
    uint64_t next_us; /* limits and warnings are not reported again before */
} tc_link_text;

/* What was last reported, so that a change is noticed. */
typedef struct {
    uint32_t transitions;
    uint8_t limit_reason, warnings;
} tc_link_reported;

typedef struct {
    const tc_link_config* config;
    tc_controller* controller;
    uint64_t clock_us;      /* the link's time: since the start, without steps of the caller's clock */
    uint64_t caller_us;     /* what the caller's clock showed last */
    uint64_t pending;       /* bits: what is to be sent (link_out) */
    int64_t byte_credit_us; /* bytes that may be sent now, times a million */
    uint64_t credit_at_us;
    tc_link_lease lease;
    tc_link_upload upload;
    tc_link_reading reading;
    tc_link_log log;
    tc_link_text text;
    tc_link_challenge challenge;
    tc_link_timesync timesync;
    tc_link_line line;
    tc_link_budget holder_checks, other_checks;
    int32_t bulk_lead; /* weighted bytes by which bulk is ahead of its share beside telemetry */
    uint32_t random;
    tc_link_refusal refused; /* somebody asked to begin and may not */
    tc_link_commit commit;   /* the last one, answered again when it is repeated */
    tc_link_reported reported;
    tc_link_order_result order;   /* of the station in control, answered again when it is repeated */
    tc_link_order_result foreign; /* of one that is not */
    float home_world_m[3];        /* where it last stood */
    uint16_t state_sequence;
    uint8_t sequence;
    uint8_t turn; /* link_out: the telemetry whose turn it is */
    tc_link_counts counts;
    tc_link_standard standard;
    uint64_t next_us[TC_LINK_PERIODS];
    uint32_t period_us[TC_LINK_PERIODS]; /* of a series, where it is not TC_LINK_PRESET */
    tc_signing signing;
    tc_link_set set;
    tc_link_lottery lottery;
} tc_link;

/* `config` stays the caller's, and stays where it is. */
void tc_link_init(tc_link* link, tc_controller* controller, const tc_link_config* config, uint64_t now_us);

/* Takes bytes from the radio: a datagram of whole frames, which are read where they lie; or, with a `stream`, a piece
   of a byte stream, which may end in the middle of a frame. Every serial port has its own `stream`. */
void tc_link_receive(tc_link* link, const uint8_t* bytes, size_t n, tc_parser* stream, uint64_t now_us);

/* Once after every tick: notes what is to be sent, writes the log, goes on with a commit by a slice, and reports to
   the controller for how long the operator has been silent. */
void tc_link_update(tc_link* link, uint64_t now_us);

/* The next frame to send, or 0 when there is nothing to send or the byte rate is used up. */
size_t tc_link_transmit(tc_link* link, uint8_t frame[TC_FRAME_MAX], uint64_t now_us);

/* What to keep over a restart, at least every TC_LINK_KEEP_PERIOD_S, as the next start_10us. It lies ahead of the
   present stamp by that period and the acceptance window, so that every stamp used until the next time is below it. */
uint64_t tc_link_stamp_to_keep(const tc_link* link);

/* Brings a trajectory kept over a restart back through all checks into the active slot. All of it in one call, so at
   the start only, before the first tick. */
tc_reason tc_link_restore(tc_link* link, const tc_trajectory* kept);

#ifdef __cplusplus
}
#endif

#endif

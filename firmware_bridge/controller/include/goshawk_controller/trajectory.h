/* The trajectory store: a staged slot that an upload fills piece by piece, and the active slot that is flown.

   A trajectory is up to TC_MAX_SEGMENTS segments of four polynomials (world x, y, z in metres, yaw in radians) in the
   centred variable s = 2 t / T - 1 in [-1, 1]; float32 in that basis errs by 0.05 mm where powers of seconds err by
   centimetres. Time is integer microseconds. An upload goes

       tc_store_begin -> tc_store_put_segment (any order, repeats welcome) -> tc_store_put_sample (optional)
       -> tc_store_finish (checks everything, a slice a call) -> tc_store_activate (by id and CRC)

   Nothing that happens to the staged slot can touch the active one; a refused or interrupted upload changes nothing. */
#ifndef GOSHAWK_CONTROLLER_TRAJECTORY_H
#define GOSHAWK_CONTROLLER_TRAJECTORY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "goshawk_controller/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A slot takes about 200 bytes a segment; there are two slots. A small vehicle may build with fewer segments. */
#ifndef TC_MAX_SEGMENTS
#define TC_MAX_SEGMENTS 256
#endif
#define TC_MAX_COEFFICIENTS 12
#define TC_AXES 4
#define TC_MAX_SAMPLES 8
#define TC_SEGMENTS_PER_CALL 4 /* how many tc_store_finish checks in one call */

/* A tick may advance by at most one segment, so a segment must outlast the longest tick. */
#define TC_MIN_SEGMENT_US 20000u
#define TC_MAX_SEGMENT_US 60000000u

#define TC_MAX_CLEARANCE_M 100.0f

/* What to do when the ground has been silent for `link_loss_s` while this trajectory is flown. */
typedef enum { TC_LINK_LOSS_FINISH = 0, TC_LINK_LOSS_HOLD = 1, TC_LINK_LOSS_LAND = 2 } tc_link_loss_policy;

typedef struct {
    uint32_t duration_us;
    /* [x, y, z, yaw][ascending powers of s]; entries from the trajectory's coefficient_count on are zero. */
    float coefficient[TC_AXES][TC_MAX_COEFFICIENTS];
} tc_segment;

typedef struct {
    uint32_t id;               /* chosen by the ground; not 0 */
    uint32_t crc32;            /* tc_trajectory_crc32 over everything but this field */
    uint16_t segment_count;    /* 1 .. TC_MAX_SEGMENTS */
    uint8_t coefficient_count; /* 1 .. TC_MAX_COEFFICIENTS */
    uint8_t link_loss_policy;  /* tc_link_loss_policy */
    float clearance_m; /* proved by the planner: the supervisor's limit for the tracking error; 0 = not stated */
} tc_trajectory_header;

#define TC_ORIGIN_NAME 24u

/* Where a trajectory comes from; travels with it and means nothing to the controller. */
typedef struct {
    uint8_t map_hash[8], vehicle_hash[8];
    char name[TC_ORIGIN_NAME];
} tc_origin;

typedef struct {
    tc_trajectory_header header;
    tc_origin origin;
    uint32_t start_us[TC_MAX_SEGMENTS + 1]; /* when each segment starts; entry segment_count is the duration */
    tc_segment segment[TC_MAX_SEGMENTS];    /* in an upload: duration 0 until it has arrived */
    float least_m[3], most_m[3];            /* a box round the path, by the sizes of its coefficients */
} tc_trajectory;

/* A point of the curve as the planner evaluates it (float64 there); the vehicle compares with its own evaluation. */
typedef struct {
    uint32_t time_us;
    float value[TC_AXES];
} tc_trajectory_sample;

typedef enum { TC_STAGED_EMPTY = 0, TC_STAGED_FILLING = 1, TC_STAGED_CHECKED = 2 } tc_staged_state;

/* How far the staged trajectory has been checked as a whole: its segments in their order. */
typedef struct {
    uint16_t next;            /* the first segment that has not been looked at */
    uint32_t crc32;           /* over the header and the segments before it */
    uint8_t reason;           /* tc_reason: the first refusal so far, which counts if the CRC turns out right */
    uint16_t refused_segment; /* where that was */
} tc_store_check;

typedef struct {
    uint8_t active;       /* index of the active slot; the other one is staged */
    bool has_active;      /* false until the first activation */
    uint8_t staged_state; /* tc_staged_state */
    uint8_t sample_count;
    uint16_t refused_segment; /* which segment (or join at whose start) the last refusal is about */
    tc_store_check check;
    tc_trajectory_sample sample[TC_MAX_SAMPLES];
    tc_trajectory slot[2]; /* last: they are large */
} tc_store;

/* Value and four time derivatives of (x, y, z, yaw) at one instant. */
typedef struct {
    float position_world_m[3];
    float yaw_rad;
    float velocity_world_m_s[3];
    float yaw_rate_rad_s;
    float acceleration_world_m_s2[3];
    float yaw_acceleration_rad_s2;
    float jerk_world_m_s3[3];
    float yaw_jerk_rad_s3;
    float snap_world_m_s4[3];
    float yaw_snap_rad_s4;
} tc_setpoint;

void tc_store_init(tc_store* store);

/* Opens the staged slot for a new upload, discarding what was staged. Refuses counts out of range, id 0, and a
   clearance that is negative, beyond TC_MAX_CLEARANCE_M or not finite. */
tc_reason tc_store_begin(tc_store* store, const tc_trajectory_header* header);

/* Says where the trajectory that is being uploaded comes from. */
tc_reason tc_store_put_origin(tc_store* store, const tc_origin* origin);

/* Stores one segment of the upload after checking it alone: finite, duration, hulls of fence, speed, acceleration,
   jerk, yaw and yaw rate. The same segment may come again. Needs coefficients beyond the count to be zero (they are set
   to zero). */
tc_reason tc_store_put_segment(tc_store* store, uint16_t index, const tc_segment* segment, const tc_parameters* limits);

/* Adds a point that the planner evaluated; `tc_store_finish` compares it. At most TC_MAX_SAMPLES, else refused. */
tc_reason tc_store_put_sample(tc_store* store, const tc_trajectory_sample* sample);

/* Whether segment `index` of the running upload has arrived. */
bool tc_store_has_segment(const tc_store* store, uint16_t index);

/* All there, CRC right, continuous at every join, at rest at both ends, samples reproduced: the slot is then CHECKED
   and can be activated. On refusal the upload stays open, and `refused_segment` says where. Each call checks at most
   TC_SEGMENTS_PER_CALL segments, then the ends and samples in one call of their own; TC_BUSY: call again. */
tc_reason tc_store_finish(tc_store* store);

/* Checks up to TC_SEGMENTS_PER_CALL segments that have arrived already, so that little is left to tc_store_finish. */
void tc_store_check_ahead(tc_store* store);

/* Makes the checked slot with this id and CRC the active one. Activating what is active already is fine (repeats; the
   newer origin holds). */
tc_reason tc_store_activate(tc_store* store, uint32_t id, uint32_t crc32);

/* Throws the staged upload away. */
void tc_store_discard(tc_store* store);

/* NULL when there is none. */
const tc_trajectory* tc_store_active(const tc_store* store);
const tc_trajectory* tc_store_staged(const tc_store* store);
bool tc_store_is_active(const tc_store* store, uint32_t id, uint32_t crc32);

uint32_t tc_trajectory_duration_us(const tc_trajectory* trajectory);

/* CRC-32 (IEEE 802.3) over little-endian id u32, segment_count u16, coefficient_count u8, link_loss_policy u8,
   clearance_m float32, then per segment duration_us u32 and 4 x coefficient_count float32. */
uint32_t tc_trajectory_crc32(const tc_trajectory* trajectory);
/* Its parts: over the header; continued by one segment. */
uint32_t tc_trajectory_header_crc32(const tc_trajectory_header* header);
uint32_t tc_trajectory_segment_crc32(uint32_t crc, const tc_segment* segment, uint32_t coefficient_count);
uint32_t tc_crc32(uint32_t crc, const uint8_t* bytes, size_t count); /* start with 0 */
uint32_t tc_crc32_u32(uint32_t crc, uint32_t value);                 /* of its bytes, the lowest first */

/* Index of the segment that holds `time_us` (the later one at a join; the last one from the end on): for the
   rare look-up. In flight a cursor moves on by at most one (tc_clock). */
uint16_t tc_trajectory_find(const tc_trajectory* trajectory, uint32_t time_us);

/* Evaluates segment `index` at `time_us` + `part_us` from the trajectory's start, clamped to the segment, while path
   time runs at path_rate[0] (1 = true time) with the derivatives path_rate[1..3]. Always the same work: twelve
   coefficients.
 */
void tc_trajectory_evaluate_running(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us, float part_us,
                                    const float path_rate[4], tc_setpoint* out);
/* One set of polynomials in x, while x grows by `x_per_s` in path time. */
void tc_evaluate_polynomials(const float coefficient[TC_AXES][TC_MAX_COEFFICIENTS], float x, float x_per_s,
                             const float path_rate[4], tc_setpoint* out);
/* The `path_rate` of true time. */
extern const float tc_true_time[4];
/* At rate 1, at a whole microsecond. */
void tc_trajectory_evaluate(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us, tc_setpoint* out);

#ifdef __cplusplus
}
#endif

#endif

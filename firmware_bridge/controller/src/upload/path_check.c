/* Bounds over whole segments by Bernstein hulls, and agreement at joins.

   A polynomial lies within the hull of its Bernstein control points, and a vector's length within the longest control
   vector. The hull is loose on long segments, so a segment that seems to break a bound is looked at again in 4 and in
   16 pieces (the excess falls sixteen-fold each time) before it is refused. */
#include "path_check.h"

#include "../base/maths.h"

/* Room for what float32 storage and evaluation cost; far below what a vehicle feels. */
static const float JOIN_POSITION_M = 1e-3f; /* between the two values at a join */
static const float JOIN_VELOCITY_M_S = 5e-3f;
static const float JOIN_ACCELERATION_M_S2 = 0.05f;
static const float JOIN_YAW_RAD = 1e-3f;
static const float JOIN_YAW_RATE_RAD_S = 1e-2f; /* and at the ends */
static const float REST_VELOCITY_M_S = 0.02f;   /* at the beginning and the end of a path */
static const float REST_ACCELERATION_M_S2 = 0.1f;
static const float SAMPLE_M = 1e-3f;         /* the planner's value against ours; of the yaw in rad */
static const float LARGEST_YAW_RAD = 900.0f; /* 143 turns: float32 still resolves 0.06 mrad there */
static const uint32_t PIECES_FINEST =
    16u; /* of a segment: what a hull of so many pieces still exceeds, the path does */

typedef float points[TC_MAX_COEFFICIENTS];

/* What may not go beyond a bound: some axes as one vector, or its derivative of this order with respect to seconds. */
typedef struct {
    uint8_t first, end; /* axes */
    uint8_t order;
    uint8_t reason; /* if it does */
} claim;

static const claim claims[] = {{0, 1, 0, TC_PATH_LEAVES_FENCE}, {1, 2, 0, TC_PATH_LEAVES_FENCE},
                               {2, 3, 0, TC_PATH_LEAVES_FENCE}, {3, 4, 0, TC_OUT_OF_RANGE},
                               {0, 3, 1, TC_PATH_TOO_FAST},     {3, 4, 1, TC_PATH_YAW_RATE},
                               {0, 3, 2, TC_PATH_ACCELERATION}, {0, 3, 3, TC_PATH_JERK}};

/* Bernstein control points of a polynomial's derivative over start + width * u, u in [0, 1]: as many as coefficients.
 */
static void control_points(const float* coefficient, uint32_t count, uint32_t orders, float rate, float start,
                           float width, points out) {
    for (uint32_t i = 0; i < count; i++) out[i] = coefficient[i];
    for (uint32_t order = 0; order < orders; order++) {
        for (uint32_t i = 1; i < count; i++) out[i - 1u] = out[i] * (float)i * rate;
        out[count - 1u] = 0.0f;
    }
    for (uint32_t i = 0; i + 1u < count; i++) { /* Taylor shift by synthetic division */
        for (uint32_t j = count - 1u; j > i; j--) out[j - 1u] += start * out[j];
    }
    float scale = 1.0f; /* width^i / binomial(count - 1, i) */
    for (uint32_t i = 1; i < count; i++) {
        scale *= width * (float)i / (float)(count - i);
        out[i] *= scale;
    }
    for (uint32_t i = 0; i + 1u < count; i++) { /* binomial transform */
        for (uint32_t j = count - 1u; j > i; j--) out[j] += out[j - 1u];
    }
}

/* Whether over one piece no control vector is further than `bound` from `middle`. One axis after the other: the stack
   stays small. */
static bool piece_within(const tc_segment* segment, uint32_t count, const claim* of, float start, float width,
                         float middle, float bound) {
    points squared, hull;
    bool within = true;
    memset(squared, 0, sizeof squared);
    for (uint32_t axis = of->first; axis < of->end; axis++) {
        control_points(segment->coefficient[axis], count, of->order, 2e6f / (float)segment->duration_us, start, width,
                       hull);
        for (uint32_t i = 0; i < count; i++) squared[i] += (hull[i] - middle) * (hull[i] - middle);
    }
    for (uint32_t i = 0; i < count; i++) within = within && squared[i] <= bound * tc_abs(bound); /* NaN is not */
    return within;
}

static bool holds(const tc_segment* segment, uint32_t count, const claim* of, float middle, float bound) {
    bool within = false;
    for (uint32_t pieces = 1; pieces <= PIECES_FINEST && !within; pieces *= 4u) {
        const float width = 2.0f / (float)pieces;
        within = true;
        for (uint32_t i = 0; i < pieces && within; i++) {
            within = piece_within(segment, count, of, -1.0f + (float)i * width, width, middle, bound);
        }
    }
    return within;
}

tc_reason tc_check_segment(const tc_segment* segment, uint32_t coefficient_count, const tc_parameters* limits) {
    if (segment->duration_us < TC_MIN_SEGMENT_US || segment->duration_us > TC_MAX_SEGMENT_US) {
        return TC_SEGMENT_DURATION;
    }
    for (int axis = 0; axis < TC_AXES; axis++) {
        if (!tc_all_finite(segment->coefficient[axis], coefficient_count)) return TC_NOT_FINITE;
    }
    const float bounds[] = {LARGEST_YAW_RAD, limits->path_speed_m_s, limits->path_yaw_rate_rad_s,
                            limits->path_acceleration_m_s2, limits->path_jerk_m_s3};
    for (uint32_t i = 0; i < sizeof claims / sizeof *claims; i++) {
        float middle = 0.0f, bound;
        if (i < 3u) {
            middle = 0.5f * (limits->fence_max_world_m[i] + limits->fence_min_world_m[i]);
            bound = 0.5f * (limits->fence_max_world_m[i] - limits->fence_min_world_m[i]);
        } else {
            bound = bounds[i - 3u];
        }
        if (!holds(segment, coefficient_count, &claims[i], middle, bound)) return (tc_reason)claims[i].reason;
    }
    return TC_OK;
}

static bool near_to(const float a[3], const float b[3], float tolerance) {
    bool near = true;
    for (int i = 0; i < 3; i++) near = near && tc_abs(a[i] - b[i]) <= tolerance;
    return near;
}

tc_reason tc_check_join(const tc_trajectory* trajectory, uint16_t index) {
    tc_setpoint before, after;
    const uint32_t time_us = trajectory->start_us[index];
    tc_trajectory_evaluate(trajectory, (uint16_t)(index - 1u), time_us, &before);
    tc_trajectory_evaluate(trajectory, index, time_us, &after);
    const bool smooth =
        near_to(before.position_world_m, after.position_world_m, JOIN_POSITION_M) &&
        near_to(before.velocity_world_m_s, after.velocity_world_m_s, JOIN_VELOCITY_M_S) &&
        near_to(before.acceleration_world_m_s2, after.acceleration_world_m_s2, JOIN_ACCELERATION_M_S2) &&
        tc_abs(before.yaw_rad - after.yaw_rad) <= JOIN_YAW_RAD &&
        tc_abs(before.yaw_rate_rad_s - after.yaw_rate_rad_s) <= JOIN_YAW_RATE_RAD_S;
    return smooth ? TC_OK : TC_JUMP_AT_JOIN;
}

static bool at_rest(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us) {
    tc_setpoint point;
    tc_trajectory_evaluate(trajectory, index, time_us, &point);
    return tc_norm(point.velocity_world_m_s) <= REST_VELOCITY_M_S &&
           tc_norm(point.acceleration_world_m_s2) <= REST_ACCELERATION_M_S2 &&
           tc_abs(point.yaw_rate_rad_s) <= JOIN_YAW_RATE_RAD_S;
}

tc_reason tc_check_ends(const tc_trajectory* trajectory) {
    const uint16_t last = (uint16_t)(trajectory->header.segment_count - 1u);
    const bool resting = at_rest(trajectory, 0, 0u) && at_rest(trajectory, last, tc_trajectory_duration_us(trajectory));
    return resting ? TC_OK : TC_NOT_AT_REST;
}

tc_reason tc_check_sample(const tc_trajectory* trajectory, const tc_trajectory_sample* sample) {
    tc_setpoint ours;
    tc_trajectory_evaluate(trajectory, tc_trajectory_find(trajectory, sample->time_us), sample->time_us, &ours);
    const bool same =
        near_to(ours.position_world_m, sample->value, SAMPLE_M) && tc_abs(ours.yaw_rad - sample->value[3]) <= SAMPLE_M;
    return same ? TC_OK : TC_SAMPLE_MISMATCH;
}

/* Bounds over whole segments by Bernstein hulls, and agreement at joins.

   A polynomial lies within the hull of its Bernstein control points, and a vector's length within the longest control
   vector. The hull is loose on long segments, so a segment that seems to break a bound is looked at again in 4 and in
   16 pieces (the excess falls sixteen-fold each time) before it is refused. */
#include "path_check.h"

#include "maths.h"

/* Room for what float32 storage and evaluation cost; far below what a vehicle feels. */
#define JOIN_POSITION_M 1e-3f
#define JOIN_VELOCITY_M_S 5e-3f
#define JOIN_ACCELERATION_M_S2 0.05f
#define JOIN_YAW_RAD 1e-3f
#define JOIN_YAW_RATE_RAD_S 1e-2f
#define REST_VELOCITY_M_S 0.02f
#define REST_ACCELERATION_M_S2 0.1f
#define SAMPLE_M 1e-3f
#define LARGEST_YAW_RAD 900.0f
#define PIECES_FINEST 16

typedef float points[TC_MAX_COEFFICIENTS];

/* A polynomial of `count` coefficients, or its derivative: one of `order` is meant, with respect to seconds. */
typedef struct {
    const float* coefficient;
    uint32_t count;
    uint32_t order;
    float rate; /* ds / dt */
} curve;

static uint32_t derivative(const curve* c, points out) {
    uint32_t count = c->count;
    for (uint32_t i = 0; i < count; i++) out[i] = c->coefficient[i];
    for (uint32_t order = 0; order < c->order; order++) {
        for (uint32_t i = 1; i < count; i++) out[i - 1u] = out[i] * (float)i * c->rate;
        if (count > 1u) {
            count--;
        } else {
            out[0] = 0.0f;
        }
    }
    return count;
}

/* Bernstein control points of c(start + width * u), u in [0, 1]; returns how many. */
static uint32_t control_points(const curve* c, float start, float width, points out) {
    const uint32_t count = derivative(c, out);
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
    return count;
}

/* The longest control vector of x, y and z over one piece. One axis after the other: the stack stays small. */
static float longest(const tc_segment* segment, const curve* of, float start, float width) {
    curve c = *of;
    points squared, hull;
    uint32_t count = 0;
    float largest = 0.0f;
    memset(squared, 0, sizeof squared);
    for (int axis = 0; axis < 3; axis++) {
        c.coefficient = segment->coefficient[axis];
        count = control_points(&c, start, width, hull);
        for (uint32_t i = 0; i < count; i++) squared[i] += hull[i] * hull[i];
    }
    for (uint32_t i = 0; i < count; i++) largest = tc_max(largest, squared[i]);
    return sqrtf(largest);
}

static bool length_within(const tc_segment* segment, const curve* c, float bound) {
    for (uint32_t pieces = 1; pieces <= PIECES_FINEST; pieces *= 4u) {
        const float width = 2.0f / (float)pieces;
        bool within = true;
        for (uint32_t i = 0; i < pieces && within; i++) {
            within = longest(segment, c, -1.0f + (float)i * width, width) <= bound;
        }
        if (within) return true;
    }
    return false;
}

static bool range_within(const curve* c, float low, float high) {
    for (uint32_t pieces = 1; pieces <= PIECES_FINEST; pieces *= 4u) {
        const float width = 2.0f / (float)pieces;
        bool within = true;
        for (uint32_t i = 0; i < pieces && within; i++) {
            points hull;
            const uint32_t count = control_points(c, -1.0f + (float)i * width, width, hull);
            for (uint32_t j = 0; j < count; j++) within = within && hull[j] >= low && hull[j] <= high;
        }
        if (within) return true;
    }
    return false;
}

tc_reason tc_check_segment(const tc_segment* segment, uint32_t coefficient_count, const tc_path_limits* limits) {
    if (segment->duration_us < TC_MIN_SEGMENT_US || segment->duration_us > TC_MAX_SEGMENT_US) {
        return TC_SEGMENT_DURATION;
    }
    for (int axis = 0; axis < TC_AXES; axis++) {
        if (!tc_all_finite(segment->coefficient[axis], coefficient_count)) return TC_NOT_FINITE;
    }
    curve c = {.count = coefficient_count, .rate = 2e6f / (float)segment->duration_us};
    for (int axis = 0; axis < 3; axis++) {
        c.coefficient = segment->coefficient[axis];
        if (!range_within(&c, limits->fence_min_world_m[axis], limits->fence_max_world_m[axis])) {
            return TC_PATH_LEAVES_FENCE;
        }
    }
    c.coefficient = segment->coefficient[3];
    if (!range_within(&c, -LARGEST_YAW_RAD, LARGEST_YAW_RAD)) return TC_OUT_OF_RANGE;
    c.order = 1;
    if (!length_within(segment, &c, limits->speed_m_s)) return TC_PATH_TOO_FAST;
    if (!range_within(&c, -limits->yaw_rate_rad_s, limits->yaw_rate_rad_s)) return TC_PATH_YAW_RATE;
    c.order = 2;
    if (!length_within(segment, &c, limits->acceleration_m_s2)) return TC_PATH_ACCELERATION;
    c.order = 3;
    return length_within(segment, &c, limits->jerk_m_s3) ? TC_OK : TC_PATH_JERK;
}

static bool close(const float a[3], const float b[3], float tolerance) {
    bool near = true;
    for (int i = 0; i < 3; i++) near = near && tc_abs(a[i] - b[i]) <= tolerance;
    return near;
}

tc_reason tc_check_join(const tc_trajectory* trajectory, uint16_t index) {
    tc_setpoint point;
    float position[3], velocity[3], acceleration[3];
    const uint32_t time_us = trajectory->start_us[index];
    tc_trajectory_evaluate(trajectory, (uint16_t)(index - 1u), time_us, 0.0f, &point);
    tc_copy(position, point.position_world_m); /* a second whole set-point would cost more stack */
    tc_copy(velocity, point.velocity_world_m_s);
    tc_copy(acceleration, point.acceleration_world_m_s2);
    const float yaw = point.yaw_rad, yaw_rate = point.yaw_rate_rad_s;
    tc_trajectory_evaluate(trajectory, index, time_us, 0.0f, &point);
    const bool smooth = close(position, point.position_world_m, JOIN_POSITION_M) &&
                        close(velocity, point.velocity_world_m_s, JOIN_VELOCITY_M_S) &&
                        close(acceleration, point.acceleration_world_m_s2, JOIN_ACCELERATION_M_S2) &&
                        tc_abs(yaw - point.yaw_rad) <= JOIN_YAW_RAD &&
                        tc_abs(yaw_rate - point.yaw_rate_rad_s) <= JOIN_YAW_RATE_RAD_S;
    return smooth ? TC_OK : TC_JUMP_AT_JOIN;
}

static bool at_rest(const tc_trajectory* trajectory, uint16_t index, uint32_t time_us) {
    tc_setpoint point;
    tc_trajectory_evaluate(trajectory, index, time_us, 0.0f, &point);
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
    tc_trajectory_evaluate(trajectory, tc_trajectory_find(trajectory, sample->time_us), sample->time_us, 0.0f, &ours);
    const bool same =
        close(ours.position_world_m, sample->value, SAMPLE_M) && tc_abs(ours.yaw_rad - sample->value[3]) <= SAMPLE_M;
    return same ? TC_OK : TC_SAMPLE_MISMATCH;
}

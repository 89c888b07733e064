/* The parameter table: names for MAVLink (at most 16 characters), ranges, defaults. Rigter et al.'s vehicle is preset.

   It is kept in columns, and ranges once each: that takes 1.4 kB less than an array of rows. */
#include "goshawk_controller/parameters.h"

#include "goshawk_controller/trajectory.h"
#include "maths.h"

/* Smallest and largest. */
enum {
    MASS,
    GRAVITY,
    INERTIA,
    OFFSET,
    ARM,
    SPIN,
    HEALTH,
    TO_2,
    PER_SQUARE,
    INFLOW,
    SIGNED_CENTI,
    DENSITY,
    AREA,
    TORQUE,
    SLOWEST,
    FASTEST,
    TO_5000,
    TO_1,
    TO_TENTH,
    TO_100,
    TO_FIFTH,
    FILTER,
    TO_50,
    TO_5,
    BRISK,
    TO_500,
    SLEW,
    TO_HALF,
    PLACE,
    PUSH,
    JERK,
    TURN,
    NEAR,
    BRAKE,
    CLIMB,
    SINK,
    STALE,
    TILT,
    TILTED,
    SILENCE,
    WAIT,
    WEIGHT,
    FALL,
    RANGES
};
static const float ranges[RANGES][2] = {[MASS] = {0.01f, 50.0f},
                                        [GRAVITY] = {9.7f, 9.9f},
                                        [INERTIA] = {1e-6f, 10.0f},
                                        [OFFSET] = {-0.2f, 0.2f},
                                        [ARM] = {-2.0f, 2.0f},
                                        [SPIN] = {-1.0f, 1.0f},
                                        [HEALTH] = {0.3f, 2.0f},
                                        [TO_2] = {0.0f, 2.0f},
                                        [PER_SQUARE] = {1e-10f, 0.1f},
                                        [INFLOW] = {-0.1f, 0.0f},
                                        [SIGNED_CENTI] = {-0.01f, 0.01f},
                                        [DENSITY] = {0.3f, 1.5f},
                                        [AREA] = {1e-4f, 5.0f},
                                        [TORQUE] = {1e-12f, 0.01f},
                                        [SLOWEST] = {1.0f, 5000.0f},
                                        [FASTEST] = {10.0f, 20000.0f},
                                        [TO_5000] = {0.0f, 5000.0f},
                                        [TO_1] = {0.0f, 1.0f},
                                        [TO_TENTH] = {0.0f, 0.1f},
                                        [TO_100] = {0.0f, 100.0f},
                                        [TO_FIFTH] = {0.0f, 0.2f},
                                        [FILTER] = {0.001f, 0.2f},
                                        [TO_50] = {0.0f, 50.0f},
                                        [TO_5] = {0.0f, 5.0f},
                                        [BRISK] = {0.1f, 50.0f},
                                        [TO_500] = {0.0f, 500.0f},
                                        [SLEW] = {1.0f, 200.0f},
                                        [TO_HALF] = {0.0f, 0.5f},
                                        [PLACE] = {-10000.0f, 10000.0f},
                                        [PUSH] = {0.1f, 100.0f},
                                        [JERK] = {1.0f, 10000.0f},
                                        [TURN] = {0.1f, 30.0f},
                                        [NEAR] = {0.01f, 10.0f},
                                        [BRAKE] = {0.2f, 20.0f},
                                        [CLIMB] = {0.1f, 5.0f},
                                        [SINK] = {0.1f, 3.0f},
                                        [STALE] = {0.01f, 1.0f},
                                        [TILT] = {0.2f, 3.0f},
                                        [TILTED] = {0.02f, 2.0f},
                                        [SILENCE] = {0.2f, 60.0f},
                                        [WAIT] = {1.0f, 3600.0f},
                                        [WEIGHT] = {0.5f, 1.0f},
                                        [FALL] = {0.5f, 60.0f}};

#define RANGE_BITS 63u
#define GROUND 0u  /* may change only when disarmed */
#define FLIGHT 64u /* may change in the air */
#define REAL 0u
#define WHOLE 128u /* a choice, whole numbers only */

/* In the order of tc_parameters: place there, name, when it may change, kind, range, preset. */
/* clang-format off: one parameter per line reads as the table it is */
#define PARAMETERS(ROW)                                                       \
    ROW(mass_kg, "mass_kg", FLIGHT, REAL, MASS, 0.70f)                        \
    ROW(gravity_m_s2, "gravity_m_s2", GROUND, REAL, GRAVITY, 9.80665f)        \
    ROW(inertia_kg_m2[0], "inertia_xx", GROUND, REAL, INERTIA, 0.00306f)      \
    ROW(inertia_kg_m2[1], "inertia_yy", GROUND, REAL, INERTIA, 0.00442f)      \
    ROW(inertia_kg_m2[2], "inertia_zz", GROUND, REAL, INERTIA, 0.00441f)      \
    ROW(centre_of_mass_m[0], "com_x_m", GROUND, REAL, OFFSET, 0.0014f)        \
    ROW(centre_of_mass_m[1], "com_y_m", GROUND, REAL, OFFSET, 0.00018f)       \
    ROW(rotor_x_m[0], "rotor0_x_m", GROUND, REAL, ARM, 0.0885f)               \
    ROW(rotor_x_m[1], "rotor1_x_m", GROUND, REAL, ARM, -0.0885f)              \
    ROW(rotor_x_m[2], "rotor2_x_m", GROUND, REAL, ARM, -0.0885f)              \
    ROW(rotor_x_m[3], "rotor3_x_m", GROUND, REAL, ARM, 0.0885f)               \
    ROW(rotor_y_m[0], "rotor0_y_m", GROUND, REAL, ARM, 0.0885f)               \
    ROW(rotor_y_m[1], "rotor1_y_m", GROUND, REAL, ARM, 0.0885f)               \
    ROW(rotor_y_m[2], "rotor2_y_m", GROUND, REAL, ARM, -0.0885f)              \
    ROW(rotor_y_m[3], "rotor3_y_m", GROUND, REAL, ARM, -0.0885f)              \
    ROW(rotor_spin[0], "rotor0_spin", GROUND, WHOLE, SPIN, 1.0f)              \
    ROW(rotor_spin[1], "rotor1_spin", GROUND, WHOLE, SPIN, -1.0f)             \
    ROW(rotor_spin[2], "rotor2_spin", GROUND, WHOLE, SPIN, 1.0f)              \
    ROW(rotor_spin[3], "rotor3_spin", GROUND, WHOLE, SPIN, -1.0f)             \
    ROW(rotor_gain[0], "rotor0_gain", FLIGHT, REAL, HEALTH, 1.0f)             \
    ROW(rotor_gain[1], "rotor1_gain", FLIGHT, REAL, HEALTH, 1.0f)             \
    ROW(rotor_gain[2], "rotor2_gain", FLIGHT, REAL, HEALTH, 1.0f)             \
    ROW(rotor_gain[3], "rotor3_gain", FLIGHT, REAL, HEALTH, 1.0f)             \
    ROW(thrust_model, "thrust_model", GROUND, WHOLE, TO_2, 2.0f)              \
    ROW(k1_n_s2, "k1_n_s2", GROUND, REAL, PER_SQUARE, 3.119e-6f)              \
    ROW(k2_n_s2_m, "k2_n_s2_m", GROUND, REAL, INFLOW, -1.547e-4f)             \
    ROW(quad_n_s2, "quad_n_s2", GROUND, REAL, PER_SQUARE, 1.897e-6f)          \
    ROW(inflow_kg, "inflow_kg", FLIGHT, REAL, SIGNED_CENTI, 0.0f)             \
    ROW(air_density_kg_m3, "air_density", FLIGHT, REAL, DENSITY, 1.2f)        \
    ROW(disk_area_m2, "disk_area_m2", GROUND, REAL, AREA, 0.0126677f)         \
    ROW(cq_n_m_s2, "cq_n_m_s2", GROUND, REAL, TORQUE, 3.100e-8f)              \
    ROW(rotor_min_rad_s, "rotor_min_rad_s", GROUND, REAL, SLOWEST, 250.0f)    \
    ROW(rotor_max_rad_s, "rotor_max_rad_s", GROUND, REAL, FASTEST, 1800.0f)   \
    ROW(rotor_idle_rad_s, "rotor_idle_rad_s", GROUND, REAL, TO_5000, 150.0f)  \
    ROW(rotor_drag_s_m, "rotor_drag_s_m", FLIGHT, REAL, TO_1, 0.0175f)        \
    ROW(rotor_drag_kg, "rotor_drag_kg", FLIGHT, REAL, TO_TENTH, 0.0f)         \
    ROW(parasitic_kg_m[0], "drag_x_kg_m", FLIGHT, REAL, TO_1, 0.0055f)        \
    ROW(parasitic_kg_m[1], "drag_y_kg_m", FLIGHT, REAL, TO_1, 0.0055f)        \
    ROW(parasitic_kg_m[2], "drag_z_kg_m", FLIGHT, REAL, TO_1, 0.0185f)        \
    ROW(parasitic_norm_kg_m[0], "drag_norm_x_kg_m", FLIGHT, REAL, TO_1, 0.0f) \
    ROW(parasitic_norm_kg_m[1], "drag_norm_y_kg_m", FLIGHT, REAL, TO_1, 0.0f) \
    ROW(parasitic_norm_kg_m[2], "drag_norm_z_kg_m", FLIGHT, REAL, TO_1, 0.0f) \
    ROW(lift_kg_m, "lift_kg_m", FLIGHT, REAL, TO_TENTH, 0.0f)                 \
    ROW(flapping_kg_m, "flapping_kg_m", FLIGHT, REAL, SIGNED_CENTI, 0.0f)     \
    ROW(damping_n_m_s[0], "damping_x_n_m_s", FLIGHT, REAL, TO_1, 0.0f)        \
    ROW(damping_n_m_s[1], "damping_y_n_m_s", FLIGHT, REAL, TO_1, 0.0f)        \
    ROW(damping_n_m_s[2], "damping_z_n_m_s", FLIGHT, REAL, TO_1, 0.0f)        \
    ROW(battery_reference_v, "battery_ref_v", FLIGHT, REAL, TO_100, 0.0f)     \
    ROW(battery_gain_1_v, "battery_gain_1_v", FLIGHT, REAL, TO_1, 0.0f)       \
    ROW(rotor_lag_s, "rotor_lag_s", FLIGHT, REAL, TO_FIFTH, 0.0f)             \
    ROW(lead_filter_s, "lead_filter_s", FLIGHT, REAL, FILTER, 0.015f)         \
    ROW(drag_velocity, "drag_velocity", FLIGHT, WHOLE, TO_2, 1.0f)            \
    ROW(airflow_velocity, "airflow_velocity", FLIGHT, WHOLE, TO_2, 1.0f)      \
    ROW(kp_xy_1_s2, "kp_xy_1_s2", FLIGHT, REAL, TO_100, 9.0f)                 \
    ROW(kp_z_1_s2, "kp_z_1_s2", FLIGHT, REAL, TO_100, 14.0f)                  \
    ROW(kd_xy_1_s, "kd_xy_1_s", FLIGHT, REAL, TO_50, 5.0f)                    \
    ROW(kd_z_1_s, "kd_z_1_s", FLIGHT, REAL, TO_50, 7.0f)                      \
    ROW(ki_xy_1_s3, "ki_xy_1_s3", FLIGHT, REAL, TO_50, 0.0f)                  \
    ROW(ki_z_1_s3, "ki_z_1_s3", FLIGHT, REAL, TO_50, 0.0f)                    \
    ROW(integral_m_s2, "integral_m_s2", FLIGHT, REAL, TO_5, 1.5f)             \
    ROW(integral_gate_m, "integral_gate_m", FLIGHT, REAL, TO_5, 0.3f)         \
    ROW(feedback_m_s2, "feedback_m_s2", FLIGHT, REAL, BRISK, 8.0f)            \
    ROW(attitude_mode, "attitude_mode", FLIGHT, WHOLE, TO_1, 0.0f)            \
    ROW(att_kp_xy_1_s2, "att_kp_xy_1_s2", FLIGHT, REAL, TO_5000, 220.0f)      \
    ROW(att_kp_z_1_s2, "att_kp_z_1_s2", FLIGHT, REAL, TO_5000, 40.0f)         \
    ROW(att_kd_xy_1_s, "att_kd_xy_1_s", FLIGHT, REAL, TO_500, 28.0f)          \
    ROW(att_kd_z_1_s, "att_kd_z_1_s", FLIGHT, REAL, TO_500, 11.0f)            \
    ROW(feed_rate, "feed_rate", FLIGHT, WHOLE, TO_1, 1.0f)                    \
    ROW(feed_torque, "feed_torque", FLIGHT, WHOLE, TO_1, 1.0f)                \
    ROW(tilt_slew_rad_s, "tilt_slew_rad_s", FLIGHT, REAL, SLEW, 30.0f)        \
    ROW(yaw_slew_rad_s, "yaw_slew_rad_s", FLIGHT, REAL, BRISK, 8.0f)          \
    ROW(yaw_share, "yaw_share", FLIGHT, REAL, TO_HALF, 0.2f)                  \
    ROW(predict_max_s, "predict_max_s", FLIGHT, REAL, TO_TENTH, 0.1f)         \
    ROW(predict_extra_s, "predict_extra_s", FLIGHT, REAL, TO_TENTH, 0.0f)     \
    ROW(fence_min_world_m[0], "fence_min_x_m", GROUND, REAL, PLACE, -1000.0f) \
    ROW(fence_min_world_m[1], "fence_min_y_m", GROUND, REAL, PLACE, -1000.0f) \
    ROW(fence_min_world_m[2], "fence_min_z_m", GROUND, REAL, PLACE, -1000.0f) \
    ROW(fence_max_world_m[0], "fence_max_x_m", GROUND, REAL, PLACE, 1000.0f)  \
    ROW(fence_max_world_m[1], "fence_max_y_m", GROUND, REAL, PLACE, 1000.0f)  \
    ROW(fence_max_world_m[2], "fence_max_z_m", GROUND, REAL, PLACE, 1000.0f)  \
    ROW(path_speed_m_s, "path_speed_m_s", GROUND, REAL, BRISK, 12.0f)         \
    ROW(path_acceleration_m_s2, "path_acc_m_s2", GROUND, REAL, PUSH, 20.0f)   \
    ROW(path_jerk_m_s3, "path_jerk_m_s3", GROUND, REAL, JERK, 300.0f)         \
    ROW(path_yaw_rate_rad_s, "path_yaw_rad_s", GROUND, REAL, TURN, 7.0f)      \
    ROW(start_radius_m, "start_radius_m", FLIGHT, REAL, NEAR, 0.5f)           \
    ROW(brake_m_s2, "brake_m_s2", FLIGHT, REAL, BRAKE, 4.0f)                  \
    ROW(take_off_m_s, "take_off_m_s", FLIGHT, REAL, CLIMB, 1.0f)              \
    ROW(landing_m_s, "landing_m_s", FLIGHT, REAL, SINK, 0.8f)                 \
    ROW(estimate_stale_s, "stale_s", FLIGHT, REAL, STALE, 0.1f)               \
    ROW(tilt_error_rad, "tilt_error_rad", FLIGHT, REAL, TILT, 1.2f)           \
    ROW(tilt_error_s, "tilt_error_s", FLIGHT, REAL, TILTED, 0.3f)             \
    ROW(link_loss_s, "link_loss_s", FLIGHT, REAL, SILENCE, 2.0f)              \
    ROW(link_hold_s, "link_hold_s", FLIGHT, REAL, WAIT, 20.0f)                \
    ROW(emergency_sink, "emergency_sink", FLIGHT, REAL, WEIGHT, 0.93f)        \
    ROW(emergency_s, "emergency_s", FLIGHT, REAL, FALL, 5.0f)
/* clang-format on */

#define COUNT ((uint16_t)(sizeof(tc_parameters) / sizeof(float)))
#define AT(field) (offsetof(tc_parameters, field) / sizeof(float))
#define NAME(field, name, when, kind, range, preset) name "\0"
#define CODE(field, name, when, kind, range, preset) [AT(field)] = (uint8_t)((when) | (kind) | (range)),
#define PRESET(field, name, when, kind, range, preset) [AT(field)] = (preset),
#define ONE(field, name, when, kind, range, preset) +(sizeof(name) <= TC_PARAMETER_NAME_SIZE ? 1u : 1000u)

static const char names[] = PARAMETERS(NAME);
static const uint8_t codes[] = {PARAMETERS(CODE)};
static const float presets[] = {PARAMETERS(PRESET)};

_Static_assert((0u PARAMETERS(ONE)) == COUNT && sizeof codes == COUNT,
               "every parameter has a row and a name that fits");
_Static_assert((unsigned)RANGES <= RANGE_BITS, "a range fits into its bits");

static float read(const tc_parameters* parameters, uint16_t index) {
    float value;
    memcpy(&value, (const uint8_t*)parameters + sizeof value * index, sizeof value);
    return value;
}

static void write(tc_parameters* parameters, uint16_t index, float value) {
    memcpy((uint8_t*)parameters + sizeof value * index, &value, sizeof value);
}

static tc_reason acceptable(uint16_t index, float value) {
    const float* range = ranges[codes[index] & RANGE_BITS];
    if (!tc_finite(value)) return TC_NOT_FINITE;
    if (value < range[0] || value > range[1]) return TC_OUT_OF_RANGE;
    const float off = value - (float)(int32_t)value;
    return (codes[index] & WHOLE) != 0u && (off > 0.0f || off < 0.0f) ? TC_OUT_OF_RANGE : TC_OK;
}

uint16_t tc_parameters_count(void) { return COUNT; }

const char* tc_parameters_name(uint16_t index) {
    const char* name = names;
    for (uint16_t i = 0; i < index && i < COUNT; i++) name += strlen(name) + 1u;
    return name; /* behind the last one stands an empty one */
}

bool tc_parameters_in_flight(uint16_t index) { return index < COUNT && (codes[index] & FLIGHT) != 0u; }

bool tc_parameters_range(uint16_t index, float* smallest, float* largest, float* preset) {
    if (index >= COUNT) return false;
    *smallest = ranges[codes[index] & RANGE_BITS][0];
    *largest = ranges[codes[index] & RANGE_BITS][1];
    *preset = presets[index];
    return true;
}

int32_t tc_parameters_find(const char* name) {
    const char* at = names;
    for (uint16_t i = 0; i < COUNT; i++) {
        if (strncmp(name, at, TC_PARAMETER_NAME_SIZE - 1) == 0) return i;
        at += strlen(at) + 1u;
    }
    return -1;
}

void tc_parameters_default(tc_parameters* parameters) {
    for (uint16_t i = 0; i < COUNT; i++) write(parameters, i, presets[i]);
}

float tc_parameters_get(const tc_parameters* parameters, uint16_t index) {
    return index < COUNT ? read(parameters, index) : 0.0f;
}

tc_reason tc_parameters_put(tc_parameters* parameters, uint16_t index, float value) {
    if (index >= COUNT) return TC_UNKNOWN_PARAMETER;
    const tc_reason reason = acceptable(index, value);
    if (reason == TC_OK) write(parameters, index, value);
    return reason;
}

tc_reason tc_parameters_check(const tc_parameters* parameters, uint16_t* index) {
    for (uint16_t i = 0; i < COUNT; i++) {
        const tc_reason reason = acceptable(i, read(parameters, i));
        if (reason != TC_OK) {
            if (index != NULL) *index = i;
            return reason;
        }
    }
    return TC_OK;
}

uint32_t tc_parameters_crc32(const tc_parameters* parameters) {
    uint32_t crc = 0;
    for (uint16_t i = 0; i < COUNT; i++) {
        const float value = read(parameters, i);
        uint32_t bits;
        memcpy(&bits, &value, sizeof bits);
        const uint8_t bytes[4] = {(uint8_t)bits, (uint8_t)(bits >> 8), (uint8_t)(bits >> 16), (uint8_t)(bits >> 24)};
        crc = tc_crc32(crc, bytes, sizeof bytes);
    }
    return crc;
}

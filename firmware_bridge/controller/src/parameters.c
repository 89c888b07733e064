/* The parameter table: names for MAVLink (at most 16 characters), ranges, defaults. Rigter et al.'s vehicle is preset.

   It is kept in columns, and packed: a name says only in what it differs from the one before, ranges stand once each,
   and a number is one of 12 bits with so many decimals. That takes 0.9 kB where plain rows would take 3.3 kB. */
#include "goshawk_controller/parameters.h"

#include "goshawk_controller/trajectory.h"
#include "maths.h"
#include "words.h"

/* A number: (u >> 4) - 2048 tenths of it over 10^(u & 15); so -2048 .. 2047, and from one zero to 14 decimals. */
#define ZERO 2048
#define PACKED(number, decimals) (uint16_t)(((number) + ZERO) * 16 + (decimals) + 1)
/* As `decimals`: one of the few numbers that do not fit. */
#define WIDE 14
enum { GRAVITATION, DISK, K1, WIDES };
static const float wide[WIDES] = {[GRAVITATION] = 9.80665f, [DISK] = 0.0126677f, [K1] = 3.119e-6f};

/* Smallest and largest. Of the first three whole numbers are meant: choices. */
enum {
    SPIN,
    CHOICE,
    SWITCH,
    MASS,
    GRAVITY,
    INERTIA,
    OFFSET,
    ARM,
    HEALTH,
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
static const uint16_t ranges[RANGES][2] = {
    [SPIN] = {PACKED(-1, 0), PACKED(1, 0)},        [CHOICE] = {PACKED(0, 0), PACKED(2, 0)},
    [SWITCH] = {PACKED(0, 0), PACKED(1, 0)},       [MASS] = {PACKED(1, 2), PACKED(50, 0)},
    [GRAVITY] = {PACKED(97, 1), PACKED(99, 1)},    [INERTIA] = {PACKED(1, 6), PACKED(10, 0)},
    [OFFSET] = {PACKED(-2, 1), PACKED(2, 1)},      [ARM] = {PACKED(-2, 0), PACKED(2, 0)},
    [HEALTH] = {PACKED(3, 1), PACKED(2, 0)},       [PER_SQUARE] = {PACKED(1, 10), PACKED(1, 1)},
    [INFLOW] = {PACKED(-1, 1), PACKED(0, 0)},      [SIGNED_CENTI] = {PACKED(-1, 2), PACKED(1, 2)},
    [DENSITY] = {PACKED(3, 1), PACKED(15, 1)},     [AREA] = {PACKED(1, 4), PACKED(5, 0)},
    [TORQUE] = {PACKED(1, 12), PACKED(1, 2)},      [SLOWEST] = {PACKED(1, 0), PACKED(500, -1)},
    [FASTEST] = {PACKED(10, 0), PACKED(2000, -1)}, [TO_5000] = {PACKED(0, 0), PACKED(500, -1)},
    [TO_1] = {PACKED(0, 0), PACKED(1, 0)},         [TO_TENTH] = {PACKED(0, 0), PACKED(1, 1)},
    [TO_100] = {PACKED(0, 0), PACKED(100, 0)},     [TO_FIFTH] = {PACKED(0, 0), PACKED(2, 1)},
    [FILTER] = {PACKED(1, 3), PACKED(2, 1)},       [TO_50] = {PACKED(0, 0), PACKED(50, 0)},
    [TO_5] = {PACKED(0, 0), PACKED(5, 0)},         [BRISK] = {PACKED(1, 1), PACKED(50, 0)},
    [TO_500] = {PACKED(0, 0), PACKED(500, 0)},     [SLEW] = {PACKED(1, 0), PACKED(200, 0)},
    [TO_HALF] = {PACKED(0, 0), PACKED(5, 1)},      [PLACE] = {PACKED(-1000, -1), PACKED(1000, -1)},
    [PUSH] = {PACKED(1, 1), PACKED(100, 0)},       [JERK] = {PACKED(1, 0), PACKED(1000, -1)},
    [TURN] = {PACKED(1, 1), PACKED(30, 0)},        [NEAR] = {PACKED(1, 2), PACKED(10, 0)},
    [BRAKE] = {PACKED(2, 1), PACKED(20, 0)},       [CLIMB] = {PACKED(1, 1), PACKED(5, 0)},
    [SINK] = {PACKED(1, 1), PACKED(3, 0)},         [STALE] = {PACKED(1, 2), PACKED(1, 0)},
    [TILT] = {PACKED(2, 1), PACKED(3, 0)},         [TILTED] = {PACKED(2, 2), PACKED(2, 0)},
    [SILENCE] = {PACKED(2, 1), PACKED(60, 0)},     [WAIT] = {PACKED(1, 0), PACKED(180, -1)},
    [WEIGHT] = {PACKED(5, 1), PACKED(1, 0)},       [FALL] = {PACKED(5, 1), PACKED(60, 0)}};

#define RANGE_BITS 63u
#define GROUND 0u  /* may change only when disarmed */
#define FLIGHT 64u /* may change in the air */
#define FIRST 0u
#define MORE 128u /* another one of the same name: the next rotor or axis */

/* Units that end names. */
#define KG "A"
#define M "B"
#define S "C"
#define M_S "D"
#define M_S2 "E"
#define RAD_S "F"
#define KG_M "G"
#define N_S2 "H"
#define PER_S "I"
#define PER_S2 "J"
#define PER_S3 "K"
static const char units[] =
    "kg\0"
    "m\0"
    "s\0"
    "m_s\0"
    "m_s2\0"
    "rad_s\0"
    "kg_m\0"
    "n_s2\0"
    "1_s\0"
    "1_s2\0"
    "1_s3\0";

/* In the order of tc_parameters: place there, how many characters of the name before are kept (unit not counted), the
   rest of the name (* stands for the rotor, @ for the axis), when it may change, whether it goes by the name of the row
   before, range, preset as a number and its decimals. */
/* clang-format off: one parameter per line reads as the table it is */
#define PARAMETERS(ROW)                                                                  \
    ROW(mass_kg, "\000", "mass" KG, FLIGHT, FIRST, MASS, 7, 1)                           \
    ROW(gravity_m_s2, "\000", "gravity" M_S2, GROUND, FIRST, GRAVITY, GRAVITATION, WIDE) \
    ROW(inertia_kg_m2[0], "\000", "inertia_@@", GROUND, FIRST, INERTIA, 306, 5)          \
    ROW(inertia_kg_m2[1], "", "", GROUND, MORE, INERTIA, 442, 5)                         \
    ROW(inertia_kg_m2[2], "", "", GROUND, MORE, INERTIA, 441, 5)                         \
    ROW(centre_of_mass_m[0], "\000", "com_x" M, GROUND, FIRST, OFFSET, 14, 4)            \
    ROW(centre_of_mass_m[1], "\004", "y" M, GROUND, FIRST, OFFSET, 18, 5)                \
    ROW(rotor_x_m[0], "\000", "rotor*_x" M, GROUND, FIRST, ARM, 885, 4)                  \
    ROW(rotor_x_m[1], "", "", GROUND, MORE, ARM, -885, 4)                                \
    ROW(rotor_x_m[2], "", "", GROUND, MORE, ARM, -885, 4)                                \
    ROW(rotor_x_m[3], "", "", GROUND, MORE, ARM, 885, 4)                                 \
    ROW(rotor_y_m[0], "\007", "y" M, GROUND, FIRST, ARM, 885, 4)                         \
    ROW(rotor_y_m[1], "", "", GROUND, MORE, ARM, 885, 4)                                 \
    ROW(rotor_y_m[2], "", "", GROUND, MORE, ARM, -885, 4)                                \
    ROW(rotor_y_m[3], "", "", GROUND, MORE, ARM, -885, 4)                                \
    ROW(rotor_spin[0], "\007", "spin", GROUND, FIRST, SPIN, 1, 0)                        \
    ROW(rotor_spin[1], "", "", GROUND, MORE, SPIN, -1, 0)                                \
    ROW(rotor_spin[2], "", "", GROUND, MORE, SPIN, 1, 0)                                 \
    ROW(rotor_spin[3], "", "", GROUND, MORE, SPIN, -1, 0)                                \
    ROW(rotor_gain[0], "\007", "gain", FLIGHT, FIRST, HEALTH, 1, 0)                      \
    ROW(rotor_gain[1], "", "", FLIGHT, MORE, HEALTH, 1, 0)                               \
    ROW(rotor_gain[2], "", "", FLIGHT, MORE, HEALTH, 1, 0)                               \
    ROW(rotor_gain[3], "", "", FLIGHT, MORE, HEALTH, 1, 0)                               \
    ROW(thrust_model, "\000", "thrust_model", GROUND, FIRST, CHOICE, 2, 0)               \
    ROW(k1_n_s2, "\000", "k1" N_S2, GROUND, FIRST, PER_SQUARE, K1, WIDE)                 \
    ROW(k2_n_s2_m, "\000", "k2_n_s2_m", GROUND, FIRST, INFLOW, -1547, 7)                 \
    ROW(quad_n_s2, "\000", "quad" N_S2, GROUND, FIRST, PER_SQUARE, 1897, 9)              \
    ROW(inflow_kg, "\000", "inflow" KG, FLIGHT, FIRST, SIGNED_CENTI, 0, 0)               \
    ROW(air_density_kg_m3, "\000", "air_density", FLIGHT, FIRST, DENSITY, 12, 1)         \
    ROW(disk_area_m2, "\000", "disk_area_m2", GROUND, FIRST, AREA, DISK, WIDE)           \
    ROW(cq_n_m_s2, "\000", "cq_n_m_s2", GROUND, FIRST, TORQUE, 31, 9)                    \
    ROW(rotor_min_rad_s, "\000", "rotor_min" RAD_S, GROUND, FIRST, SLOWEST, 250, 0)      \
    ROW(rotor_max_rad_s, "\006", "max" RAD_S, GROUND, FIRST, FASTEST, 1800, 0)           \
    ROW(rotor_idle_rad_s, "\006", "idle" RAD_S, GROUND, FIRST, TO_5000, 150, 0)          \
    ROW(rotor_drag_s_m, "\006", "drag_s_m", FLIGHT, FIRST, TO_1, 175, 4)                 \
    ROW(rotor_drag_kg, "\012", KG, FLIGHT, FIRST, TO_TENTH, 0, 0)                        \
    ROW(parasitic_kg_m[0], "\000", "drag_@" KG_M, FLIGHT, FIRST, TO_1, 55, 4)            \
    ROW(parasitic_kg_m[1], "", "", FLIGHT, MORE, TO_1, 55, 4)                            \
    ROW(parasitic_kg_m[2], "", "", FLIGHT, MORE, TO_1, 185, 4)                           \
    ROW(parasitic_norm_kg_m[0], "\005", "norm_@" KG_M, FLIGHT, FIRST, TO_1, 0, 0)        \
    ROW(parasitic_norm_kg_m[1], "", "", FLIGHT, MORE, TO_1, 0, 0)                        \
    ROW(parasitic_norm_kg_m[2], "", "", FLIGHT, MORE, TO_1, 0, 0)                        \
    ROW(lift_kg_m, "\000", "lift" KG_M, FLIGHT, FIRST, TO_TENTH, 0, 0)                   \
    ROW(flapping_kg_m, "\000", "flapping" KG_M, FLIGHT, FIRST, SIGNED_CENTI, 0, 0)       \
    ROW(damping_n_m_s[0], "\000", "damping_@_n_m_s", FLIGHT, FIRST, TO_1, 0, 0)          \
    ROW(damping_n_m_s[1], "", "", FLIGHT, MORE, TO_1, 0, 0)                              \
    ROW(damping_n_m_s[2], "", "", FLIGHT, MORE, TO_1, 0, 0)                              \
    ROW(battery_reference_v, "\000", "battery_ref_v", FLIGHT, FIRST, TO_100, 0, 0)       \
    ROW(battery_gain_1_v, "\010", "gain_1_v", FLIGHT, FIRST, TO_1, 0, 0)                 \
    ROW(rotor_lag_s, "\000", "rotor_lag" S, FLIGHT, FIRST, TO_FIFTH, 0, 0)               \
    ROW(lead_filter_s, "\000", "lead_filter" S, FLIGHT, FIRST, FILTER, 15, 3)            \
    ROW(drag_velocity, "\000", "drag_velocity", FLIGHT, FIRST, CHOICE, 1, 0)             \
    ROW(airflow_velocity, "\000", "airflow_velocity", FLIGHT, FIRST, CHOICE, 1, 0)       \
    ROW(kp_xy_1_s2, "\000", "kp_xy" PER_S2, FLIGHT, FIRST, TO_100, 9, 0)                 \
    ROW(kp_z_1_s2, "\003", "z" PER_S2, FLIGHT, FIRST, TO_100, 14, 0)                     \
    ROW(kd_xy_1_s, "\000", "kd_xy" PER_S, FLIGHT, FIRST, TO_50, 5, 0)                    \
    ROW(kd_z_1_s, "\003", "z" PER_S, FLIGHT, FIRST, TO_50, 7, 0)                         \
    ROW(ki_xy_1_s3, "\000", "ki_xy" PER_S3, FLIGHT, FIRST, TO_50, 0, 0)                  \
    ROW(ki_z_1_s3, "\003", "z" PER_S3, FLIGHT, FIRST, TO_50, 0, 0)                       \
    ROW(integral_m_s2, "\000", "integral" M_S2, FLIGHT, FIRST, TO_5, 15, 1)              \
    ROW(integral_gate_m, "\010", "_gate" M, FLIGHT, FIRST, TO_5, 3, 1)                   \
    ROW(feedback_m_s2, "\000", "feedback" M_S2, FLIGHT, FIRST, BRISK, 8, 0)              \
    ROW(attitude_mode, "\000", "attitude_mode", FLIGHT, FIRST, SWITCH, 0, 0)             \
    ROW(att_kp_xy_1_s2, "\003", "_kp_xy" PER_S2, FLIGHT, FIRST, TO_5000, 220, 0)         \
    ROW(att_kp_z_1_s2, "\007", "z" PER_S2, FLIGHT, FIRST, TO_5000, 40, 0)                \
    ROW(att_kd_xy_1_s, "\004", "kd_xy" PER_S, FLIGHT, FIRST, TO_500, 28, 0)              \
    ROW(att_kd_z_1_s, "\007", "z" PER_S, FLIGHT, FIRST, TO_500, 11, 0)                   \
    ROW(feed_rate, "\000", "feed_rate", FLIGHT, FIRST, SWITCH, 1, 0)                     \
    ROW(feed_torque, "\005", "torque", FLIGHT, FIRST, SWITCH, 1, 0)                      \
    ROW(tilt_slew_rad_s, "\000", "tilt_slew" RAD_S, FLIGHT, FIRST, SLEW, 30, 0)          \
    ROW(yaw_slew_rad_s, "\000", "yaw_slew" RAD_S, FLIGHT, FIRST, BRISK, 8, 0)            \
    ROW(yaw_share, "\004", "share", FLIGHT, FIRST, TO_HALF, 2, 1)                        \
    ROW(predict_max_s, "\000", "predict_max" S, FLIGHT, FIRST, TO_TENTH, 1, 1)           \
    ROW(predict_extra_s, "\010", "extra" S, FLIGHT, FIRST, TO_TENTH, 0, 0)               \
    ROW(fence_min_world_m[0], "\000", "fence_min_@" M, GROUND, FIRST, PLACE, -1000, 0)   \
    ROW(fence_min_world_m[1], "", "", GROUND, MORE, PLACE, -1000, 0)                     \
    ROW(fence_min_world_m[2], "", "", GROUND, MORE, PLACE, -1000, 0)                     \
    ROW(fence_max_world_m[0], "\006", "max_@" M, GROUND, FIRST, PLACE, 1000, 0)          \
    ROW(fence_max_world_m[1], "", "", GROUND, MORE, PLACE, 1000, 0)                      \
    ROW(fence_max_world_m[2], "", "", GROUND, MORE, PLACE, 1000, 0)                      \
    ROW(path_speed_m_s, "\000", "path_speed" M_S, GROUND, FIRST, BRISK, 12, 0)           \
    ROW(path_acceleration_m_s2, "\005", "acc" M_S2, GROUND, FIRST, PUSH, 20, 0)          \
    ROW(path_jerk_m_s3, "\005", "jerk_m_s3", GROUND, FIRST, JERK, 300, 0)                \
    ROW(path_yaw_rate_rad_s, "\005", "yaw" RAD_S, GROUND, FIRST, TURN, 7, 0)             \
    ROW(start_radius_m, "\000", "start_radius" M, FLIGHT, FIRST, NEAR, 5, 1)             \
    ROW(brake_m_s2, "\000", "brake" M_S2, FLIGHT, FIRST, BRAKE, 4, 0)                    \
    ROW(take_off_m_s, "\000", "take_off" M_S, FLIGHT, FIRST, CLIMB, 1, 0)                \
    ROW(landing_m_s, "\000", "landing" M_S, FLIGHT, FIRST, SINK, 8, 1)                   \
    ROW(estimate_stale_s, "\000", "stale" S, FLIGHT, FIRST, STALE, 1, 1)                 \
    ROW(tilt_error_rad, "\000", "tilt_error_rad", FLIGHT, FIRST, TILT, 12, 1)            \
    ROW(tilt_error_s, "\012", S, FLIGHT, FIRST, TILTED, 3, 1)                            \
    ROW(link_loss_s, "\000", "link_loss" S, FLIGHT, FIRST, SILENCE, 2, 0)                \
    ROW(link_hold_s, "\005", "hold" S, FLIGHT, FIRST, WAIT, 20, 0)                       \
    ROW(emergency_sink, "\000", "emergency_sink", FLIGHT, FIRST, WEIGHT, 93, 2)          \
    ROW(emergency_s, "\011", S, FLIGHT, FIRST, FALL, 5, 0)
/* clang-format on */

#define COUNT ((uint16_t)(sizeof(tc_parameters) / sizeof(float)))
#define AT(field) (offsetof(tc_parameters, field) / sizeof(float))
#define NAME(field, keep, name, when, more, range, number, decimals) keep name
#define CODE(field, keep, name, when, more, range, number, decimals) [AT(field)] = (uint8_t)((when) | (more) | (range)),
#define PRESET(field, keep, name, when, more, range, number, decimals) [AT(field)] = PACKED(number, decimals),
#define ONE(field, keep, name, when, more, range, number, decimals) +1u

static const char names[] = PARAMETERS(NAME);
static const uint8_t codes[] = {PARAMETERS(CODE)};
static const uint16_t presets[] = {PARAMETERS(PRESET)};

_Static_assert((0u PARAMETERS(ONE)) == COUNT && sizeof codes == COUNT, "every parameter has a row");
_Static_assert((unsigned)RANGES <= RANGE_BITS, "a range fits into its bits");

static TC_RARE float unpacked(uint32_t packed) {
    const int32_t number = (int32_t)(packed >> 4) - ZERO;
    if ((packed & 15u) == WIDE + 1u) return wide[number];
    float whole = 1.0f;
    for (uint32_t decimals = packed & 15u; decimals > 0u; decimals--) whole *= 10.0f;
    return (float)(number * 10) / whole;
}

static float read(const tc_parameters* parameters, uint16_t index) {
    float value;
    memcpy(&value, (const uint8_t*)parameters + sizeof value * index, sizeof value);
    return value;
}

static void write(tc_parameters* parameters, uint16_t index, float value) {
    memcpy((uint8_t*)parameters + sizeof value * index, &value, sizeof value);
}

static tc_reason acceptable(uint16_t index, float value) {
    const uint32_t kind = codes[index] & RANGE_BITS;
    if (!tc_finite(value)) return TC_NOT_FINITE;
    if (value < unpacked(ranges[kind][0]) || value > unpacked(ranges[kind][1])) return TC_OUT_OF_RANGE;
    const float off = value - (float)(int32_t)value;
    return kind <= (uint32_t)SWITCH && tc_abs(off) > 0.0f ? TC_OUT_OF_RANGE : TC_OK;
}

uint16_t tc_parameters_count(void) { return COUNT; }

/* A whole name, filled up with zeros. */
static void spell(const char* stem, uint32_t length, uint32_t member, char name[TC_PARAMETER_NAME_SIZE]) {
    uint32_t n = 0u;
    for (uint32_t i = 0; i < length; i++) {
        char c = stem[i];
        if (c >= 'A' && c <= 'Z') {
            name[n] = '_';
            n++;
            for (const char* unit = tc_word(units, (uint32_t)(c - 'A')); *unit != '\0'; unit++) {
                name[n] = *unit;
                n++;
            }
        } else {
            if (c == '*') c = (char)('0' + member);
            if (c == '@') c = (char)('x' + member);
            name[n] = c;
            n++;
        }
    }
    for (; n < TC_PARAMETER_NAME_SIZE; n++) name[n] = '\0';
}

static bool same(const char* a, const char* b) {
    bool equal = true;
    for (uint32_t i = 0; equal && i < TC_PARAMETER_NAME_SIZE - 1u; i++) {
        equal = a[i] == b[i];
        if (a[i] == '\0') break;
    }
    return equal;
}

/* Goes through the names up to that of `end`, or until one is `wanted` (when not NULL); where it stopped. */
static TC_RARE uint16_t go_to(uint16_t end, const char* wanted, char name[TC_PARAMETER_NAME_SIZE]) {
    char stem[TC_PARAMETER_NAME_SIZE];
    const char* next = names;
    uint32_t length = 0u, member = 0u;
    uint16_t index = 0;
    for (; index < COUNT; index++) {
        member++;
        if ((codes[index] & MORE) == 0u) {
            member = 0u;
            length = (uint32_t)*next;
            next++;
            while (*next >= ' ') {
                stem[length] = *next;
                length++;
                next++;
            }
        }
        spell(stem, length, member, name);
        if (index == end || (wanted != NULL && same(wanted, name))) break;
    }
    return index;
}

void tc_parameters_name(uint16_t index, char name[TC_PARAMETER_NAME_SIZE]) {
    if (go_to(index, NULL, name) == COUNT) name[0] = '\0';
}

bool tc_parameters_in_flight(uint16_t index) { return index < COUNT && (codes[index] & FLIGHT) != 0u; }

bool tc_parameters_range(uint16_t index, float* smallest, float* largest, float* preset) {
    if (index >= COUNT) return false;
    *smallest = unpacked(ranges[codes[index] & RANGE_BITS][0]);
    *largest = unpacked(ranges[codes[index] & RANGE_BITS][1]);
    *preset = unpacked(presets[index]);
    return true;
}

int32_t tc_parameters_find(const char* name) {
    char found[TC_PARAMETER_NAME_SIZE];
    const uint16_t index = go_to(COUNT, name, found);
    return index < COUNT ? (int32_t)index : -1;
}

void tc_parameters_default(tc_parameters* parameters) {
    for (uint16_t i = 0; i < COUNT; i++) write(parameters, i, unpacked(presets[i]));
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
    for (uint16_t i = 0; i < COUNT; i++) crc = tc_crc32_u32(crc, tc_bits(read(parameters, i)));
    return crc;
}

/* The parameter table: names for MAVLink (at most 16 characters), ranges, defaults. The defaults are Rigter et al.'s
   vehicle. Members of tc_parameters and rows of the table stand in the same order; a static assertion counts them. */
#include "goshawk_controller/parameters.h"

#include "goshawk_controller/trajectory.h"
#include "maths.h"

/* When a parameter may change, whether it is a choice among whole numbers, whether trajectories are checked by it. */
enum { GROUND = 0, FLIGHT = 1, WHOLE = 2, LIMIT = 4 };

typedef struct {
    const char* name;
    uint16_t index; /* of the member, counted in floats */
    uint8_t flags;
    float minimum, maximum, preset;
    const char* unit; /* "1": dimensionless */
} parameter_row;

#define AT(member) (uint16_t)(offsetof(tc_parameters, member) / sizeof(float))

/* clang-format off: one parameter per line reads as the table it is */
static const parameter_row table[] = {
    {"mass_kg", AT(mass_kg), FLIGHT, 0.01f, 50.0f, 0.7f, "kg"},
    {"gravity_m_s2", AT(gravity_m_s2), GROUND, 9.7f, 9.9f, 9.80665f, "m/s2"},
    {"inertia_xx", AT(inertia_kg_m2[0]), GROUND, 1.0e-6f, 10.0f, 0.00306f, "kg m2"},
    {"inertia_yy", AT(inertia_kg_m2[1]), GROUND, 1.0e-6f, 10.0f, 0.00442f, "kg m2"},
    {"inertia_zz", AT(inertia_kg_m2[2]), GROUND, 1.0e-6f, 10.0f, 0.00441f, "kg m2"},
    {"com_x_m", AT(centre_of_mass_m[0]), GROUND, -0.2f, 0.2f, 0.0014f, "m"},
    {"com_y_m", AT(centre_of_mass_m[1]), GROUND, -0.2f, 0.2f, 0.00018f, "m"},
    {"rotor0_x_m", AT(rotor_x_m[0]), GROUND, -2.0f, 2.0f, 0.0885f, "m"},
    {"rotor1_x_m", AT(rotor_x_m[1]), GROUND, -2.0f, 2.0f, -0.0885f, "m"},
    {"rotor2_x_m", AT(rotor_x_m[2]), GROUND, -2.0f, 2.0f, -0.0885f, "m"},
    {"rotor3_x_m", AT(rotor_x_m[3]), GROUND, -2.0f, 2.0f, 0.0885f, "m"},
    {"rotor0_y_m", AT(rotor_y_m[0]), GROUND, -2.0f, 2.0f, 0.0885f, "m"},
    {"rotor1_y_m", AT(rotor_y_m[1]), GROUND, -2.0f, 2.0f, 0.0885f, "m"},
    {"rotor2_y_m", AT(rotor_y_m[2]), GROUND, -2.0f, 2.0f, -0.0885f, "m"},
    {"rotor3_y_m", AT(rotor_y_m[3]), GROUND, -2.0f, 2.0f, -0.0885f, "m"},
    {"rotor0_spin", AT(rotor_spin[0]), GROUND | WHOLE, -1.0f, 1.0f, 1.0f, "1"},
    {"rotor1_spin", AT(rotor_spin[1]), GROUND | WHOLE, -1.0f, 1.0f, -1.0f, "1"},
    {"rotor2_spin", AT(rotor_spin[2]), GROUND | WHOLE, -1.0f, 1.0f, 1.0f, "1"},
    {"rotor3_spin", AT(rotor_spin[3]), GROUND | WHOLE, -1.0f, 1.0f, -1.0f, "1"},
    {"rotor0_gain", AT(rotor_gain[0]), FLIGHT, 0.3f, 2.0f, 1.0f, "1"},
    {"rotor1_gain", AT(rotor_gain[1]), FLIGHT, 0.3f, 2.0f, 1.0f, "1"},
    {"rotor2_gain", AT(rotor_gain[2]), FLIGHT, 0.3f, 2.0f, 1.0f, "1"},
    {"rotor3_gain", AT(rotor_gain[3]), FLIGHT, 0.3f, 2.0f, 1.0f, "1"},
    {"thrust_model", AT(thrust_model), GROUND | WHOLE, 0.0f, 2.0f, 2.0f, "1"},
    {"k1_n_s2", AT(k1_n_s2), GROUND, 1.0e-10f, 0.1f, 3.119e-6f, "N s2"},
    {"k2_n_s2_m", AT(k2_n_s2_m), GROUND, -0.1f, 0.0f, -0.0001547f, "N s2/m"},
    {"quad_n_s2", AT(quad_n_s2), GROUND, 1.0e-10f, 0.1f, 1.897e-6f, "N s2"},
    {"inflow_kg", AT(inflow_kg), FLIGHT, -0.01f, 0.01f, 0.0f, "kg"},
    {"air_density", AT(air_density_kg_m3), FLIGHT, 0.3f, 1.5f, 1.2f, "kg/m3"},
    {"disk_area_m2", AT(disk_area_m2), GROUND, 0.0001f, 5.0f, 0.0126677f, "m2"},
    {"cq_n_m_s2", AT(cq_n_m_s2), GROUND, 1.0e-12f, 0.01f, 3.1e-8f, "N m s2"},
    {"rotor_min_rad_s", AT(rotor_min_rad_s), GROUND, 1.0f, 5000.0f, 250.0f, "rad/s"},
    {"rotor_max_rad_s", AT(rotor_max_rad_s), GROUND, 10.0f, 20000.0f, 1800.0f, "rad/s"},
    {"rotor_idle_rad_s", AT(rotor_idle_rad_s), GROUND, 0.0f, 5000.0f, 150.0f, "rad/s"},
    {"rotor_drag_s_m", AT(rotor_drag_s_m), FLIGHT, 0.0f, 1.0f, 0.0175f, "s/m"},
    {"rotor_drag_kg", AT(rotor_drag_kg), FLIGHT, 0.0f, 0.1f, 0.0f, "kg"},
    {"drag_x_kg_m", AT(parasitic_kg_m[0]), FLIGHT, 0.0f, 1.0f, 0.0055f, "kg/m"},
    {"drag_y_kg_m", AT(parasitic_kg_m[1]), FLIGHT, 0.0f, 1.0f, 0.0055f, "kg/m"},
    {"drag_z_kg_m", AT(parasitic_kg_m[2]), FLIGHT, 0.0f, 1.0f, 0.0185f, "kg/m"},
    {"drag_norm_x_kg_m", AT(parasitic_norm_kg_m[0]), FLIGHT, 0.0f, 1.0f, 0.0f, "kg/m"},
    {"drag_norm_y_kg_m", AT(parasitic_norm_kg_m[1]), FLIGHT, 0.0f, 1.0f, 0.0f, "kg/m"},
    {"drag_norm_z_kg_m", AT(parasitic_norm_kg_m[2]), FLIGHT, 0.0f, 1.0f, 0.0f, "kg/m"},
    {"lift_kg_m", AT(lift_kg_m), FLIGHT, 0.0f, 0.1f, 0.0f, "kg/m"},
    {"flapping_kg_m", AT(flapping_kg_m), FLIGHT, -0.01f, 0.01f, 0.0f, "kg/m"},
    {"damping_x_n_m_s", AT(damping_n_m_s[0]), FLIGHT, 0.0f, 1.0f, 0.0f, "N m s"},
    {"damping_y_n_m_s", AT(damping_n_m_s[1]), FLIGHT, 0.0f, 1.0f, 0.0f, "N m s"},
    {"damping_z_n_m_s", AT(damping_n_m_s[2]), FLIGHT, 0.0f, 1.0f, 0.0f, "N m s"},
    {"battery_ref_v", AT(battery_reference_v), FLIGHT, 0.0f, 100.0f, 0.0f, "V"},
    {"battery_gain_1_v", AT(battery_gain_1_v), FLIGHT, 0.0f, 1.0f, 0.0f, "1/V"},
    {"rotor_lag_s", AT(rotor_lag_s), FLIGHT, 0.0f, 0.2f, 0.0f, "s"},
    {"lead_filter_s", AT(lead_filter_s), FLIGHT, 0.001f, 0.2f, 0.015f, "s"},
    {"drag_velocity", AT(drag_velocity), FLIGHT | WHOLE, 0.0f, 2.0f, 1.0f, "1"},
    {"airflow_velocity", AT(airflow_velocity), FLIGHT | WHOLE, 0.0f, 2.0f, 1.0f, "1"},
    {"kp_xy_1_s2", AT(kp_xy_1_s2), FLIGHT, 0.0f, 100.0f, 9.0f, "1/s2"},
    {"kp_z_1_s2", AT(kp_z_1_s2), FLIGHT, 0.0f, 100.0f, 14.0f, "1/s2"},
    {"kd_xy_1_s", AT(kd_xy_1_s), FLIGHT, 0.0f, 50.0f, 5.0f, "1/s"},
    {"kd_z_1_s", AT(kd_z_1_s), FLIGHT, 0.0f, 50.0f, 7.0f, "1/s"},
    {"ki_xy_1_s3", AT(ki_xy_1_s3), FLIGHT, 0.0f, 50.0f, 0.0f, "1/s3"},
    {"ki_z_1_s3", AT(ki_z_1_s3), FLIGHT, 0.0f, 50.0f, 0.0f, "1/s3"},
    {"integral_m_s2", AT(integral_m_s2), FLIGHT, 0.0f, 5.0f, 1.5f, "m/s2"},
    {"integral_gate_m", AT(integral_gate_m), FLIGHT, 0.0f, 5.0f, 0.3f, "m"},
    {"feedback_m_s2", AT(feedback_m_s2), FLIGHT, 0.1f, 50.0f, 8.0f, "m/s2"},
    {"attitude_mode", AT(attitude_mode), FLIGHT | WHOLE, 0.0f, 1.0f, 0.0f, "1"},
    {"att_kp_xy_1_s2", AT(att_kp_xy_1_s2), FLIGHT, 0.0f, 5000.0f, 220.0f, "1/s2"},
    {"att_kp_z_1_s2", AT(att_kp_z_1_s2), FLIGHT, 0.0f, 5000.0f, 40.0f, "1/s2"},
    {"att_kd_xy_1_s", AT(att_kd_xy_1_s), FLIGHT, 0.0f, 500.0f, 28.0f, "1/s"},
    {"att_kd_z_1_s", AT(att_kd_z_1_s), FLIGHT, 0.0f, 500.0f, 11.0f, "1/s"},
    {"feed_rate", AT(feed_rate), FLIGHT | WHOLE, 0.0f, 1.0f, 1.0f, "1"},
    {"feed_torque", AT(feed_torque), FLIGHT | WHOLE, 0.0f, 1.0f, 1.0f, "1"},
    {"tilt_slew_rad_s", AT(tilt_slew_rad_s), FLIGHT, 1.0f, 200.0f, 30.0f, "rad/s"},
    {"yaw_slew_rad_s", AT(yaw_slew_rad_s), FLIGHT, 0.1f, 50.0f, 8.0f, "rad/s"},
    {"yaw_share", AT(yaw_share), FLIGHT, 0.0f, 0.5f, 0.2f, "1"},
    {"predict_max_s", AT(predict_max_s), FLIGHT, 0.0f, 0.1f, 0.1f, "s"},
    {"predict_extra_s", AT(predict_extra_s), FLIGHT, 0.0f, 0.1f, 0.0f, "s"},
    {"observer", AT(observer), FLIGHT | WHOLE, 0.0f, 1.0f, 1.0f, "1"},
    {"obs_force_hz", AT(observer_force_hz), FLIGHT, 0.1f, 20.0f, 6.0f, "Hz"},
    {"obs_torque_hz", AT(observer_torque_hz), FLIGHT, 0.1f, 30.0f, 10.0f, "Hz"},
    {"obs_fuse_rad_s", AT(observer_fuse_rad_s), FLIGHT, 0.0f, 50.0f, 15.0f, "rad/s"},
    {"obs_force_m_s2", AT(observer_force_m_s2), FLIGHT, 0.0f, 10.0f, 4.0f, "m/s2"},
    {"obs_turn_rad_s2", AT(observer_turn_rad_s2), FLIGHT, 0.0f, 200.0f, 30.0f, "rad/s2"},
    {"fence_min_x_m", AT(fence_min_world_m[0]), GROUND | LIMIT, -10000.0f, 10000.0f, -1000.0f, "m"},
    {"fence_min_y_m", AT(fence_min_world_m[1]), GROUND | LIMIT, -10000.0f, 10000.0f, -1000.0f, "m"},
    {"fence_min_z_m", AT(fence_min_world_m[2]), GROUND | LIMIT, -10000.0f, 10000.0f, -1000.0f, "m"},
    {"fence_max_x_m", AT(fence_max_world_m[0]), GROUND | LIMIT, -10000.0f, 10000.0f, 1000.0f, "m"},
    {"fence_max_y_m", AT(fence_max_world_m[1]), GROUND | LIMIT, -10000.0f, 10000.0f, 1000.0f, "m"},
    {"fence_max_z_m", AT(fence_max_world_m[2]), GROUND | LIMIT, -10000.0f, 10000.0f, 1000.0f, "m"},
    {"path_speed_m_s", AT(path_speed_m_s), GROUND | LIMIT, 0.1f, 50.0f, 12.0f, "m/s"},
    {"path_acc_m_s2", AT(path_acceleration_m_s2), GROUND | LIMIT, 0.1f, 100.0f, 20.0f, "m/s2"},
    {"path_jerk_m_s3", AT(path_jerk_m_s3), GROUND | LIMIT, 1.0f, 10000.0f, 300.0f, "m/s3"},
    {"path_yaw_rad_s", AT(path_yaw_rate_rad_s), GROUND | LIMIT, 0.1f, 30.0f, 7.0f, "rad/s"},
    {"start_radius_m", AT(start_radius_m), FLIGHT, 0.01f, 10.0f, 0.5f, "m"},
    {"brake_m_s2", AT(brake_m_s2), FLIGHT, 0.2f, 20.0f, 4.0f, "m/s2"},
    {"take_off_m_s", AT(take_off_m_s), FLIGHT, 0.1f, 5.0f, 1.0f, "m/s"},
    {"landing_m_s", AT(landing_m_s), FLIGHT, 0.1f, 3.0f, 0.8f, "m/s"},
    {"stale_s", AT(estimate_stale_s), FLIGHT, 0.01f, 1.0f, 0.1f, "s"},
    {"tilt_error_rad", AT(tilt_error_rad), FLIGHT, 0.2f, 3.0f, 1.2f, "rad"},
    {"tilt_error_s", AT(tilt_error_s), FLIGHT, 0.02f, 2.0f, 0.3f, "s"},
    {"link_loss_s", AT(link_loss_s), FLIGHT, 0.2f, 60.0f, 2.0f, "s"},
    {"link_hold_s", AT(link_hold_s), FLIGHT, 1.0f, 1800.0f, 20.0f, "s"},
    {"emergency_sink", AT(emergency_sink), FLIGHT, 0.5f, 1.0f, 0.96f, "1"},
    {"emergency_s", AT(emergency_s), FLIGHT, 0.5f, 120.0f, 30.0f, "s"},
    {"gyro_hold_s", AT(gyro_hold_s), FLIGHT, 0.0f, 20.0f, 5.0f, "s"},
    {"reckoning_s", AT(reckoning_s), FLIGHT, 0.0f, 10.0f, 2.0f, "s"},
    {"position_std_m", AT(position_std_m), FLIGHT, 0.01f, 100.0f, 1.0f, "m"},
    {"velocity_std", AT(velocity_std_m_s), FLIGHT, 0.01f, 100.0f, 0.5f, "m/s"},
    {"clearance_m", AT(clearance_m), FLIGHT, 0.05f, 10.0f, 0.5f, "m"},
    {"hold_error_m", AT(hold_error_m), FLIGHT, 0.1f, 100.0f, 1.5f, "m"},
    {"plan_margin_m", AT(plan_margin_m), FLIGHT, 0.0f, 1000.0f, 5.0f, "m"},
    {"monitor", AT(monitor), FLIGHT | WHOLE, 0.0f, 1.0f, 1.0f, "1"},
    {"battery_arm_v", AT(battery_arm_v), FLIGHT, 0.0f, 100.0f, 0.0f, "V"},
    {"battery_warn_v", AT(battery_warn_v), FLIGHT, 0.0f, 100.0f, 0.0f, "V"},
    {"battery_land_v", AT(battery_land_v), FLIGHT, 0.0f, 100.0f, 0.0f, "V"},
};
/* clang-format on */

#define COUNT ((uint16_t)(sizeof(tc_parameters) / sizeof(float)))
_Static_assert(sizeof table / sizeof *table == COUNT, "every parameter has a row");

static float read_value(const tc_parameters* parameters, uint16_t index) {
    float value;
    memcpy(&value, (const uint8_t*)parameters + sizeof value * index, sizeof value);
    return value;
}

static void write_value(tc_parameters* parameters, uint16_t index, float value) {
    memcpy((uint8_t*)parameters + sizeof value * index, &value, sizeof value);
}

static tc_reason acceptable(const parameter_row* row, float value) {
    if (!tc_finite(value)) return TC_NOT_FINITE;
    if (value < row->minimum || value > row->maximum) return TC_OUT_OF_RANGE;
    const bool whole =
        value <= (float)(int32_t)value && value >= (float)(int32_t)value; /* a whole one's range is small */
    return (row->flags & WHOLE) != 0u && !whole ? TC_OUT_OF_RANGE : TC_OK;
}

uint16_t tc_parameters_count(void) { return COUNT; }

const char* tc_parameters_name(uint16_t index) { return index < COUNT ? table[index].name : ""; }

const char* tc_parameters_unit(uint16_t index) { return index < COUNT ? table[index].unit : ""; }

uint8_t tc_parameters_changes(const tc_parameters* before, const tc_parameters* after) {
    uint32_t changes = 0;
    for (uint16_t i = 0; i < COUNT; i++) {
        const float x = read_value(before, table[i].index), y = read_value(after, table[i].index);
        if (x > y || x < y) {
            changes |= (table[i].flags & FLIGHT) == 0u ? TC_CHANGES_GROUND : 0u;
            changes |= (table[i].flags & LIMIT) != 0u ? TC_CHANGES_LIMIT : 0u;
        }
    }
    return (uint8_t)changes;
}

bool tc_parameters_in_flight(uint16_t index) { return index < COUNT && (table[index].flags & FLIGHT) != 0u; }

bool tc_parameters_range(uint16_t index, float* smallest, float* largest, float* preset) {
    if (index >= COUNT) return false;
    *smallest = table[index].minimum;
    *largest = table[index].maximum;
    *preset = table[index].preset;
    return true;
}

int32_t tc_parameters_find(const char* name) {
    for (uint16_t i = 0; i < COUNT; i++) {
        if (strncmp(table[i].name, name, TC_PARAMETER_NAME_SIZE - 1u) == 0) return (int32_t)i;
    }
    return -1;
}

void tc_parameters_default(tc_parameters* parameters) {
    for (uint16_t i = 0; i < COUNT; i++) write_value(parameters, table[i].index, table[i].preset);
}

float tc_parameters_get(const tc_parameters* parameters, uint16_t index) {
    return index < COUNT ? read_value(parameters, table[index].index) : 0.0f;
}

tc_reason tc_parameters_put(tc_parameters* parameters, uint16_t index, float value) {
    if (index >= COUNT) return TC_UNKNOWN_PARAMETER;
    const tc_reason reason = acceptable(&table[index], value);
    if (reason == TC_OK) write_value(parameters, table[index].index, value);
    return reason;
}

tc_reason tc_parameters_check(const tc_parameters* parameters, uint16_t* index) {
    for (uint16_t i = 0; i < COUNT; i++) {
        const tc_reason reason = acceptable(&table[i], read_value(parameters, table[i].index));
        if (reason != TC_OK) {
            if (index != NULL) *index = i;
            return reason;
        }
    }
    return TC_OK;
}

uint32_t tc_parameters_crc32(const tc_parameters* parameters) {
    uint32_t crc = 0;
    for (uint16_t i = 0; i < COUNT; i++) crc = tc_crc32_u32(crc, tc_bits(read_value(parameters, table[i].index)));
    return crc;
}

/* The parameter table: names for MAVLink (at most 16 characters), ranges, defaults. Rigter et al.'s vehicle is preset.
 */
#include "goshawk_controller/parameters.h"

#include "goshawk_controller/trajectory.h"
#include "maths.h"

#define GROUND 0 /* may change only when disarmed */
#define FLIGHT 1 /* may change in the air */
#define REAL 0
#define WHOLE 1
#define AT(field) (uint16_t)offsetof(tc_parameters, field)

static const tc_parameter_info table[] = {
    {"mass_kg", AT(mass_kg), FLIGHT, REAL, 0.01f, 50.0f, 0.70f},
    {"gravity_m_s2", AT(gravity_m_s2), GROUND, REAL, 9.7f, 9.9f, 9.80665f},
    {"inertia_xx", AT(inertia_kg_m2[0]), GROUND, REAL, 1e-6f, 10.0f, 0.00306f},
    {"inertia_yy", AT(inertia_kg_m2[1]), GROUND, REAL, 1e-6f, 10.0f, 0.00442f},
    {"inertia_zz", AT(inertia_kg_m2[2]), GROUND, REAL, 1e-6f, 10.0f, 0.00441f},
    {"com_x_m", AT(centre_of_mass_m[0]), GROUND, REAL, -0.2f, 0.2f, 0.0014f},
    {"com_y_m", AT(centre_of_mass_m[1]), GROUND, REAL, -0.2f, 0.2f, 0.00018f},
    {"rotor0_x_m", AT(rotor_x_m[0]), GROUND, REAL, -2.0f, 2.0f, 0.0885f},
    {"rotor1_x_m", AT(rotor_x_m[1]), GROUND, REAL, -2.0f, 2.0f, -0.0885f},
    {"rotor2_x_m", AT(rotor_x_m[2]), GROUND, REAL, -2.0f, 2.0f, -0.0885f},
    {"rotor3_x_m", AT(rotor_x_m[3]), GROUND, REAL, -2.0f, 2.0f, 0.0885f},
    {"rotor0_y_m", AT(rotor_y_m[0]), GROUND, REAL, -2.0f, 2.0f, 0.0885f},
    {"rotor1_y_m", AT(rotor_y_m[1]), GROUND, REAL, -2.0f, 2.0f, 0.0885f},
    {"rotor2_y_m", AT(rotor_y_m[2]), GROUND, REAL, -2.0f, 2.0f, -0.0885f},
    {"rotor3_y_m", AT(rotor_y_m[3]), GROUND, REAL, -2.0f, 2.0f, -0.0885f},
    {"rotor0_spin", AT(rotor_spin[0]), GROUND, WHOLE, -1.0f, 1.0f, 1.0f},
    {"rotor1_spin", AT(rotor_spin[1]), GROUND, WHOLE, -1.0f, 1.0f, -1.0f},
    {"rotor2_spin", AT(rotor_spin[2]), GROUND, WHOLE, -1.0f, 1.0f, 1.0f},
    {"rotor3_spin", AT(rotor_spin[3]), GROUND, WHOLE, -1.0f, 1.0f, -1.0f},
    {"rotor0_gain", AT(rotor_gain[0]), FLIGHT, REAL, 0.3f, 2.0f, 1.0f},
    {"rotor1_gain", AT(rotor_gain[1]), FLIGHT, REAL, 0.3f, 2.0f, 1.0f},
    {"rotor2_gain", AT(rotor_gain[2]), FLIGHT, REAL, 0.3f, 2.0f, 1.0f},
    {"rotor3_gain", AT(rotor_gain[3]), FLIGHT, REAL, 0.3f, 2.0f, 1.0f},
    {"thrust_model", AT(thrust_model), GROUND, WHOLE, 0.0f, 2.0f, 2.0f},
    {"k1_n_s2", AT(k1_n_s2), GROUND, REAL, 1e-10f, 0.1f, 3.119e-6f},
    {"k2_n_s2_m", AT(k2_n_s2_m), GROUND, REAL, -0.1f, 0.0f, -1.547e-4f},
    {"quad_n_s2", AT(quad_n_s2), GROUND, REAL, 1e-10f, 0.1f, 1.897e-6f},
    {"inflow_kg", AT(inflow_kg), FLIGHT, REAL, -0.01f, 0.01f, 0.0f},
    {"air_density", AT(air_density_kg_m3), FLIGHT, REAL, 0.3f, 1.5f, 1.2f},
    {"disk_area_m2", AT(disk_area_m2), GROUND, REAL, 1e-4f, 5.0f, 0.0126677f},
    {"cq_n_m_s2", AT(cq_n_m_s2), GROUND, REAL, 1e-12f, 0.01f, 3.100e-8f},
    {"rotor_min_rad_s", AT(rotor_min_rad_s), GROUND, REAL, 1.0f, 5000.0f, 250.0f},
    {"rotor_max_rad_s", AT(rotor_max_rad_s), GROUND, REAL, 10.0f, 20000.0f, 1800.0f},
    {"rotor_idle_rad_s", AT(rotor_idle_rad_s), GROUND, REAL, 0.0f, 5000.0f, 150.0f},

    {"rotor_drag_s_m", AT(rotor_drag_s_m), FLIGHT, REAL, 0.0f, 1.0f, 0.0175f},
    {"rotor_drag_kg", AT(rotor_drag_kg), FLIGHT, REAL, 0.0f, 0.1f, 0.0f},
    {"drag_x_kg_m", AT(parasitic_kg_m[0]), FLIGHT, REAL, 0.0f, 1.0f, 0.0055f},
    {"drag_y_kg_m", AT(parasitic_kg_m[1]), FLIGHT, REAL, 0.0f, 1.0f, 0.0055f},
    {"drag_z_kg_m", AT(parasitic_kg_m[2]), FLIGHT, REAL, 0.0f, 1.0f, 0.0185f},
    {"drag_norm_x_kg_m", AT(parasitic_norm_kg_m[0]), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"drag_norm_y_kg_m", AT(parasitic_norm_kg_m[1]), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"drag_norm_z_kg_m", AT(parasitic_norm_kg_m[2]), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"lift_kg_m", AT(lift_kg_m), FLIGHT, REAL, 0.0f, 0.1f, 0.0f},
    {"flapping_kg_m", AT(flapping_kg_m), FLIGHT, REAL, -0.01f, 0.01f, 0.0f},
    {"damping_x_n_m_s", AT(damping_n_m_s[0]), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"damping_y_n_m_s", AT(damping_n_m_s[1]), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"damping_z_n_m_s", AT(damping_n_m_s[2]), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"battery_ref_v", AT(battery_reference_v), FLIGHT, REAL, 0.0f, 100.0f, 0.0f},
    {"battery_gain_1_v", AT(battery_gain_1_v), FLIGHT, REAL, 0.0f, 1.0f, 0.0f},
    {"rotor_lag_s", AT(rotor_lag_s), FLIGHT, REAL, 0.0f, 0.2f, 0.0f},
    {"lead_filter_s", AT(lead_filter_s), FLIGHT, REAL, 0.001f, 0.2f, 0.015f},
    {"drag_velocity", AT(drag_velocity), FLIGHT, WHOLE, 0.0f, 2.0f, 1.0f},
    {"airflow_velocity", AT(airflow_velocity), FLIGHT, WHOLE, 0.0f, 2.0f, 1.0f},

    {"kp_xy_1_s2", AT(kp_xy_1_s2), FLIGHT, REAL, 0.0f, 100.0f, 9.0f},
    {"kp_z_1_s2", AT(kp_z_1_s2), FLIGHT, REAL, 0.0f, 100.0f, 14.0f},
    {"kd_xy_1_s", AT(kd_xy_1_s), FLIGHT, REAL, 0.0f, 50.0f, 5.0f},
    {"kd_z_1_s", AT(kd_z_1_s), FLIGHT, REAL, 0.0f, 50.0f, 7.0f},
    {"ki_xy_1_s3", AT(ki_xy_1_s3), FLIGHT, REAL, 0.0f, 50.0f, 0.0f},
    {"ki_z_1_s3", AT(ki_z_1_s3), FLIGHT, REAL, 0.0f, 50.0f, 0.0f},
    {"integral_m_s2", AT(integral_m_s2), FLIGHT, REAL, 0.0f, 5.0f, 1.5f},
    {"integral_gate_m", AT(integral_gate_m), FLIGHT, REAL, 0.0f, 5.0f, 0.3f},
    {"feedback_m_s2", AT(feedback_m_s2), FLIGHT, REAL, 0.1f, 50.0f, 8.0f},

    {"attitude_mode", AT(attitude_mode), FLIGHT, WHOLE, 0.0f, 1.0f, 0.0f},
    {"att_kp_xy_1_s2", AT(att_kp_xy_1_s2), FLIGHT, REAL, 0.0f, 5000.0f, 220.0f},
    {"att_kp_z_1_s2", AT(att_kp_z_1_s2), FLIGHT, REAL, 0.0f, 5000.0f, 40.0f},
    {"att_kd_xy_1_s", AT(att_kd_xy_1_s), FLIGHT, REAL, 0.0f, 500.0f, 28.0f},
    {"att_kd_z_1_s", AT(att_kd_z_1_s), FLIGHT, REAL, 0.0f, 500.0f, 11.0f},
    {"feed_rate", AT(feed_rate), FLIGHT, WHOLE, 0.0f, 1.0f, 1.0f},
    {"feed_torque", AT(feed_torque), FLIGHT, WHOLE, 0.0f, 1.0f, 1.0f},
    {"tilt_slew_rad_s", AT(tilt_slew_rad_s), FLIGHT, REAL, 1.0f, 200.0f, 30.0f},
    {"yaw_slew_rad_s", AT(yaw_slew_rad_s), FLIGHT, REAL, 0.1f, 50.0f, 8.0f},
    {"yaw_share", AT(yaw_share), FLIGHT, REAL, 0.0f, 0.5f, 0.2f},
    {"predict_max_s", AT(predict_max_s), FLIGHT, REAL, 0.0f, 0.1f, 0.1f},
    {"predict_extra_s", AT(predict_extra_s), FLIGHT, REAL, 0.0f, 0.1f, 0.0f},

    {"fence_min_x_m", AT(fence_min_world_m[0]), GROUND, REAL, -10000.0f, 10000.0f, -1000.0f},
    {"fence_min_y_m", AT(fence_min_world_m[1]), GROUND, REAL, -10000.0f, 10000.0f, -1000.0f},
    {"fence_min_z_m", AT(fence_min_world_m[2]), GROUND, REAL, -10000.0f, 10000.0f, -1000.0f},
    {"fence_max_x_m", AT(fence_max_world_m[0]), GROUND, REAL, -10000.0f, 10000.0f, 1000.0f},
    {"fence_max_y_m", AT(fence_max_world_m[1]), GROUND, REAL, -10000.0f, 10000.0f, 1000.0f},
    {"fence_max_z_m", AT(fence_max_world_m[2]), GROUND, REAL, -10000.0f, 10000.0f, 1000.0f},
    {"path_speed_m_s", AT(path_speed_m_s), GROUND, REAL, 0.1f, 50.0f, 12.0f},
    {"path_acc_m_s2", AT(path_acceleration_m_s2), GROUND, REAL, 0.1f, 100.0f, 20.0f},
    {"path_jerk_m_s3", AT(path_jerk_m_s3), GROUND, REAL, 1.0f, 10000.0f, 300.0f},
    {"path_yaw_rad_s", AT(path_yaw_rate_rad_s), GROUND, REAL, 0.1f, 30.0f, 7.0f},
    {"start_radius_m", AT(start_radius_m), FLIGHT, REAL, 0.01f, 10.0f, 0.5f},
    {"brake_m_s2", AT(brake_m_s2), FLIGHT, REAL, 0.2f, 20.0f, 4.0f},
    {"take_off_m_s", AT(take_off_m_s), FLIGHT, REAL, 0.1f, 5.0f, 1.0f},
    {"landing_m_s", AT(landing_m_s), FLIGHT, REAL, 0.1f, 3.0f, 0.8f},
    {"stale_s", AT(estimate_stale_s), FLIGHT, REAL, 0.01f, 1.0f, 0.1f},
    {"tilt_error_rad", AT(tilt_error_rad), FLIGHT, REAL, 0.2f, 3.0f, 1.2f},
    {"tilt_error_s", AT(tilt_error_s), FLIGHT, REAL, 0.02f, 2.0f, 0.3f},
    {"link_loss_s", AT(link_loss_s), FLIGHT, REAL, 0.2f, 60.0f, 2.0f},
    {"link_hold_s", AT(link_hold_s), FLIGHT, REAL, 1.0f, 3600.0f, 20.0f},
    {"emergency_sink", AT(emergency_sink), FLIGHT, REAL, 0.5f, 1.0f, 0.93f},
    {"emergency_s", AT(emergency_s), FLIGHT, REAL, 0.5f, 60.0f, 5.0f},
};

#define COUNT ((uint16_t)(sizeof table / sizeof table[0]))
_Static_assert(sizeof table / sizeof table[0] == sizeof(tc_parameters) / sizeof(float), "every parameter has a row");

static float read(const tc_parameters* parameters, const tc_parameter_info* info) {
    float value;
    memcpy(&value, (const uint8_t*)parameters + info->offset, sizeof value);
    return value;
}

static void write(tc_parameters* parameters, const tc_parameter_info* info, float value) {
    memcpy((uint8_t*)parameters + info->offset, &value, sizeof value);
}

static tc_reason acceptable(const tc_parameter_info* info, float value) {
    if (!tc_finite(value)) return TC_NOT_FINITE;
    if (value < info->smallest || value > info->largest) return TC_OUT_OF_RANGE;
    const float off = value - (float)(int32_t)value;
    return info->whole == WHOLE && (off > 0.0f || off < 0.0f) ? TC_OUT_OF_RANGE : TC_OK;
}

uint16_t tc_parameters_count(void) { return COUNT; }

const tc_parameter_info* tc_parameters_info(uint16_t index) { return index < COUNT ? &table[index] : NULL; }

int32_t tc_parameters_find(const char* name) {
    for (uint16_t i = 0; i < COUNT; i++) {
        if (strncmp(name, table[i].name, TC_PARAMETER_NAME_SIZE - 1) == 0) return i;
    }
    return -1;
}

void tc_parameters_default(tc_parameters* parameters) {
    for (uint16_t i = 0; i < COUNT; i++) write(parameters, &table[i], table[i].preset);
}

float tc_parameters_get(const tc_parameters* parameters, uint16_t index) {
    return index < COUNT ? read(parameters, &table[index]) : 0.0f;
}

tc_reason tc_parameters_put(tc_parameters* parameters, uint16_t index, float value) {
    if (index >= COUNT) return TC_UNKNOWN_PARAMETER;
    const tc_reason reason = acceptable(&table[index], value);
    if (reason == TC_OK) write(parameters, &table[index], value);
    return reason;
}

tc_reason tc_parameters_check(const tc_parameters* parameters, uint16_t* index) {
    for (uint16_t i = 0; i < COUNT; i++) {
        const tc_reason reason = acceptable(&table[i], read(parameters, &table[i]));
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
        const float value = read(parameters, &table[i]);
        uint32_t bits;
        memcpy(&bits, &value, sizeof bits);
        const uint8_t bytes[4] = {(uint8_t)bits, (uint8_t)(bits >> 8), (uint8_t)(bits >> 16), (uint8_t)(bits >> 24)};
        crc = tc_crc32(crc, bytes, sizeof bytes);
    }
    return crc;
}

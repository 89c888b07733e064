#include "goshawk_topics.hpp"

#include <math.h>
#include <string.h>

namespace goshawk {

static constexpr float RAD_S_PER_RPM = 0.104719755f;
static constexpr uint64_t ESC_STALE_US = 100000;
static constexpr uint64_t ACCELERATION_STALE_US = 20000;

/* NED to z up, FRD to forward-left-up: the same change of signs, either way. */
static void flip(const float from[3], float to[3]) {
    to[0] = from[0];
    to[1] = -from[1];
    to[2] = -from[2];
}

static bool finite3(const float v[3]) { return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]); }

static float limited(float value, float lowest, float highest) {
    return value < lowest ? lowest : (value > highest ? highest : value);
}

void Resets::take(const vehicle_local_position_s& p, tc_estimate& estimate) {
    const uint8_t now[5] = {p.xy_reset_counter, p.z_reset_counter, p.vxy_reset_counter, p.vz_reset_counter,
                            p.heading_reset_counter};
    uint8_t most = 0;
    uint8_t steps[5];

    for (int i = 0; i < 5; i++) {
        steps[i] = _known ? static_cast<uint8_t>(now[i] - _last[i]) : 0;
        most = steps[i] > most ? steps[i] : most;
        _last[i] = now[i];
    }

    _known = true;

    if (most > 0) {
        const float position[3] = {steps[0] ? p.delta_xy[0] : 0.0f, steps[0] ? p.delta_xy[1] : 0.0f,
                                   steps[1] ? p.delta_z : 0.0f};
        const float velocity[3] = {steps[2] ? p.delta_vxy[0] : 0.0f, steps[2] ? p.delta_vxy[1] : 0.0f,
                                   steps[3] ? p.delta_vz : 0.0f};
        flip(position, _position_world_m);
        flip(velocity, _velocity_world_m_s);
        _yaw_rad = steps[4] ? -p.delta_heading : 0.0f;
        /* Several resets between two samples: only the last delta is known. The controller takes a counter that has
           gone on by two for a jump of unknown size. */
        _counter = static_cast<uint8_t>(_counter + (most > 1 ? 2 : 1));
    }

    estimate.reset_counter = _counter;
    memcpy(estimate.reset_position_world_m, _position_world_m, sizeof(_position_world_m));
    memcpy(estimate.reset_velocity_world_m_s, _velocity_world_m_s, sizeof(_velocity_world_m_s));
    estimate.reset_yaw_rad = _yaw_rad;
}

void take_position(const vehicle_local_position_s& p, tc_estimate& estimate) {
    const float position[3] = {p.x, p.y, p.z}, velocity[3] = {p.vx, p.vy, p.vz};
    estimate.position_time_us = p.timestamp_sample;
    flip(position, estimate.position_world_m);
    flip(velocity, estimate.velocity_world_m_s);
    estimate.valid = static_cast<uint8_t>(
        estimate.valid & ~(TC_VALID_POSITION_XY | TC_VALID_POSITION_Z | TC_VALID_VELOCITY_XY | TC_VALID_VELOCITY_Z));

    /* A standard deviation of NaN means unknown. */
    if (p.xy_valid && isfinite(p.eph)) {
        estimate.valid |= TC_VALID_POSITION_XY;
    }

    if (p.z_valid && isfinite(p.epv)) {
        estimate.valid |= TC_VALID_POSITION_Z;
    }

    if (p.v_xy_valid && isfinite(p.evh)) {
        estimate.valid |= TC_VALID_VELOCITY_XY;
    }

    if (p.v_z_valid && isfinite(p.evv)) {
        estimate.valid |= TC_VALID_VELOCITY_Z;
    }

    estimate.position_std_m[0] = isfinite(p.eph) ? p.eph : 0.0f;
    estimate.position_std_m[1] = isfinite(p.epv) ? p.epv : 0.0f;
    estimate.velocity_std_m_s[0] = isfinite(p.evh) ? p.evh : 0.0f;
    estimate.velocity_std_m_s[1] = isfinite(p.evv) ? p.evv : 0.0f;
}

void take_attitude(const vehicle_attitude_s& a, tc_estimate& estimate) {
    estimate.attitude_time_us = a.timestamp_sample;
    estimate.q_world_body[0] = a.q[0];
    flip(&a.q[1], &estimate.q_world_body[1]);
    estimate.valid |= TC_VALID_ATTITUDE;
}

void take_rate(const vehicle_angular_velocity_s& w, tc_estimate& estimate) {
    estimate.rate_time_us = w.timestamp_sample;
    flip(w.xyz, estimate.rate_body_rad_s);
    estimate.valid |= TC_VALID_RATE;
}

void take_acceleration(const vehicle_acceleration_s& a, tc_estimate& estimate) {
    const bool fresh = a.timestamp_sample + ACCELERATION_STALE_US > estimate.rate_time_us;
    flip(a.xyz, estimate.specific_force_body_m_s2);
    estimate.valid = static_cast<uint8_t>(estimate.valid & ~TC_VALID_SPECIFIC_FORCE);

    if (fresh && finite3(a.xyz)) {
        estimate.valid |= TC_VALID_SPECIFIC_FORCE;
    }
}

void take_battery(const battery_status_s& b, tc_estimate& estimate) {
    estimate.battery_v = b.connected && isfinite(b.voltage_v) ? b.voltage_v : 0.0f;
}

bool rotor_speeds(const esc_status_s& from, uint64_t now_us, float rotor_speed_rad_s[TC_ROTORS]) {
    int found = 0;
    const int count =
        from.esc_count < esc_status_s::CONNECTED_ESC_MAX ? from.esc_count : esc_status_s::CONNECTED_ESC_MAX;

    for (int rotor = 0; rotor < TC_ROTORS; rotor++) {
        for (int i = 0; i < count; i++) {
            const bool fresh = from.esc[i].timestamp + ESC_STALE_US > now_us;

            if (fresh &&
                from.esc[i].actuator_function == esc_report_s::ACTUATOR_FUNCTION_MOTOR1 + MOTOR_OF_ROTOR[rotor]) {
                const float rpm = static_cast<float>(from.esc[i].esc_rpm); /* negative: turns the other way */
                rotor_speed_rad_s[rotor] = RAD_S_PER_RPM * fabsf(rpm);
                found++;
                break;
            }
        }
    }

    return found == TC_ROTORS;
}

void rotor_speeds(const actuator_motors_s& from, float full_rad_s, float rotor_speed_rad_s[TC_ROTORS]) {
    for (int rotor = 0; rotor < TC_ROTORS; rotor++) {
        const float thrust = from.control[MOTOR_OF_ROTOR[rotor]];
        rotor_speed_rad_s[rotor] = isfinite(thrust) && thrust > 0.0f ? full_rad_s * sqrtf(thrust) : 0.0f;
    }
}

void fill_motors(const tc_output& output, float full_rad_s, actuator_motors_s& motors) {
    for (unsigned i = 0; i < actuator_motors_s::NUM_CONTROLS; i++) {
        motors.control[i] = NAN;
    }

    for (int rotor = 0; rotor < TC_ROTORS; rotor++) {
        const float ratio = output.rotor_speed_rad_s[rotor] / full_rad_s;

        if (ratio > 0.0f) {
            motors.control[MOTOR_OF_ROTOR[rotor]] = limited(ratio * ratio, 0.0f, 1.0f);
        }
    }

    motors.reversible_flags = 0;
}

void fill_thrust(const actuator_motors_s& motors, vehicle_thrust_setpoint_s& thrust) {
    float sum = 0.0f;

    for (int rotor = 0; rotor < TC_ROTORS; rotor++) {
        const float one = motors.control[MOTOR_OF_ROTOR[rotor]];
        sum += isfinite(one) ? one : 0.0f;
    }

    thrust.xyz[0] = thrust.xyz[1] = 0.0f;
    thrust.xyz[2] = -sum / TC_ROTORS;
}

void fill_torque(const tc_controller& controller, float full_rad_s, vehicle_torque_setpoint_s& torque) {
    const tc_parameters& p = controller.parameters;
    const float* demand = controller.telemetry.wrench.torque_n_m;
    const float rotor_n = p.quad_n_s2 * full_rad_s * full_rad_s;
    float largest[3] = {0.0f, 0.0f, 0.0f}, share[3];

    for (int rotor = 0; rotor < TC_ROTORS; rotor++) { /* two of the four at full thrust, two at none */
        largest[0] += 0.5f * rotor_n * fabsf(p.rotor_y_m[rotor]);
        largest[1] += 0.5f * rotor_n * fabsf(p.rotor_x_m[rotor]);
        largest[2] += 0.5f * p.cq_n_m_s2 * full_rad_s * full_rad_s;
    }

    for (int i = 0; i < 3; i++) {
        share[i] = largest[i] > 0.0f ? limited(demand[i] / largest[i], -1.0f, 1.0f) : 0.0f;
    }

    flip(share, torque.xyz);
}

void fill_setpoint(const tc_setpoint& from, float descend_m_s, trajectory_setpoint_s& setpoint) {
    flip(from.position_world_m, setpoint.position);
    flip(from.velocity_world_m_s, setpoint.velocity);
    flip(from.acceleration_world_m_s2, setpoint.acceleration);
    flip(from.jerk_world_m_s3, setpoint.jerk);
    setpoint.yaw = -from.yaw_rad;
    setpoint.yawspeed = -from.yaw_rate_rad_s;

    if (descend_m_s > 0.0f && setpoint.velocity[2] < descend_m_s) {
        setpoint.velocity[2] = descend_m_s;
    }
}

}  // namespace goshawk

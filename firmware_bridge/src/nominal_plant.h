// A vehicle that is exactly what the controller believes: every demanded wrench is produced at once. For batched closed
// loops (throughput, property tests); flights worth believing use vehicle.simulate.
#pragma once

#include <cmath>
#include <cstdint>

#include "goshawk_controller/goshawk_controller.h"

namespace goshawk {

class NominalPlant {
  public:
    // `row`: position 3, velocity 3, q 4, body rate 3.
    explicit NominalPlant(const double* row) {
        for (int i = 0; i < 13; i++) state_[i] = static_cast<float>(row[i]);
    }

    tc_estimate estimate(uint64_t time_us) const {
        tc_estimate e{};
        e.position_time_us = e.attitude_time_us = e.rate_time_us = time_us;
        e.valid = TC_VALID_POSE;
        for (int i = 0; i < 3; i++) {
            e.position_world_m[i] = state_[i];
            e.velocity_world_m_s[i] = state_[3 + i];
            e.rate_body_rad_s[i] = state_[10 + i];
        }
        for (int i = 0; i < 4; i++) e.q_world_body[i] = state_[6 + i];
        return e;
    }

    // Semi-implicit Euler over one control step, with the wrench the controller asked for.
    void step(const tc_controller& c, float step_s) {
        const tc_parameters& p = c.parameters;
        const bool flying = tc_mission_in_air(c.mission.state);
        float *position = state_, *velocity = state_ + 3, *q = state_ + 6, *rate = state_ + 10;
        const float thrust = flying ? c.telemetry.wrench.thrust_n : 0.0f;
        float drag[3];
        float axes[3][3] = {
            {1 - 2 * (q[2] * q[2] + q[3] * q[3]), 2 * (q[1] * q[2] + q[0] * q[3]), 2 * (q[1] * q[3] - q[0] * q[2])},
            {2 * (q[1] * q[2] - q[0] * q[3]), 1 - 2 * (q[1] * q[1] + q[3] * q[3]), 2 * (q[2] * q[3] + q[0] * q[1])},
            {2 * (q[1] * q[3] + q[0] * q[2]), 2 * (q[2] * q[3] - q[0] * q[1]), 1 - 2 * (q[1] * q[1] + q[2] * q[2])}};
        float velocity_body[3], drag_body[3];
        for (int i = 0; i < 3; i++) {
            velocity_body[i] = axes[i][0] * velocity[0] + axes[i][1] * velocity[1] + axes[i][2] * velocity[2];
        }
        (void)tc_drag(&p, velocity_body, thrust, 0.0f, drag_body);
        for (int i = 0; i < 3; i++) {
            drag[i] = axes[0][i] * drag_body[0] + axes[1][i] * drag_body[1] + axes[2][i] * drag_body[2];
        }
        const float* z = axes[2];
        for (int i = 0; i < 3; i++) {
            const float weight = i == 2 ? p.gravity_m_s2 : 0.0f;
            const float acceleration = (z[i] * thrust + drag[i]) / p.mass_kg - weight;
            if (flying) velocity[i] += acceleration * step_s;
            position[i] += velocity[i] * step_s;
        }
        turn(c, flying, step_s, q, rate);
        if (!flying) velocity[0] = velocity[1] = velocity[2] = 0.0f;
    }

    void write(float* row) const {
        for (int i = 0; i < 13; i++) row[i] = state_[i];
    }

  private:
    static void turn(const tc_controller& c, bool flying, float step_s, float* q, float* rate) {
        const float* J = c.parameters.inertia_kg_m2;
        const float* torque = c.telemetry.wrench.torque_n_m;
        const float gyroscopic[3] = {(J[2] - J[1]) * rate[1] * rate[2], (J[0] - J[2]) * rate[2] * rate[0],
                                     (J[1] - J[0]) * rate[0] * rate[1]};
        for (int i = 0; i < 3; i++) {
            rate[i] = flying ? rate[i] + step_s * (torque[i] - gyroscopic[i]) / J[i] : 0.0f;
        }
        const float h = 0.5f * step_s, x = h * rate[0], y = h * rate[1], z = h * rate[2];
        const float n[4] = {q[0] - x * q[1] - y * q[2] - z * q[3], q[1] + x * q[0] + z * q[2] - y * q[3],
                            q[2] + y * q[0] - z * q[1] + x * q[3], q[3] + z * q[0] + y * q[1] - x * q[2]};
        const float scale = 1.0f / std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + n[3] * n[3]);
        for (int i = 0; i < 4; i++) q[i] = n[i] * scale;
    }

    float state_[13];
};

}  // namespace goshawk

/* Position loop: eq. (9) with drag feed-forward and an optional, gated integrator. */
#ifndef GOSHAWK_CONTROLLER_POSITION_H
#define GOSHAWK_CONTROLLER_POSITION_H

#include "goshawk_controller/parameters.h"
#include "goshawk_controller/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    float integral_m_s2[3];
} tc_position_state;

/* Force of all modelled drag (it points against the motion), eqs. (4)-(5) and their rival forms; all in body axes.
   Returns how fast its lateral part grows with speed, N s/m: what turns acceleration into a rate of force. */
float tc_drag(const tc_parameters* parameters, const float velocity_body_m_s[3], float thrust_n,
              float mean_rotor_speed_rad_s, float drag_body_n[3]);

/* Eq. (9): the thrust vector in world axes, at most `largest_n`, for the estimated position and velocity and with the
   modelled drag cancelled. `integrate`: the gate of the integrator, flying and nothing saturated. Returns true when
   feedback or thrust had to be limited. */
bool tc_position_step(tc_position_state* state, const tc_parameters* parameters, const tc_setpoint* setpoint,
                      const float position_world_m[3], const float velocity_world_m_s[3], const float drag_world_n[3],
                      float largest_n, bool integrate, float step_s, float force_world_n[3]);

#ifdef __cplusplus
}
#endif

#endif

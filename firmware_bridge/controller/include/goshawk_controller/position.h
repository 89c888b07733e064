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

typedef struct {
    float position_world_m[3];   /* estimate */
    float velocity_world_m_s[3]; /* estimate */
    float drag_world_n[3];       /* modelled drag, to be cancelled */
    float largest_thrust_n;
    bool integrate; /* the gate: flying and nothing saturated */
} tc_position_input;

/* Force of all modelled drag in world axes (it points against the motion), eqs. (4)-(5) and their rival forms. `axes`:
   the body's x, y, z axes in world coordinates, one a row. */
void tc_drag(const tc_parameters* parameters, const float velocity_world_m_s[3], float axes[3][3], float thrust_n,
             float mean_rotor_speed_rad_s, float drag_world_n[3]);

/* Eq. (9): the thrust vector in world axes. Returns true when feedback or thrust had to be limited. */
bool tc_position_step(tc_position_state* state, const tc_parameters* parameters, const tc_setpoint* setpoint,
                      const tc_position_input* input, float step_s, float force_world_n[3]);

#ifdef __cplusplus
}
#endif

#endif

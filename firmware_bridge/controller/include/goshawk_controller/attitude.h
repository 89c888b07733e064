/* Attitude loop: PD with feed-forward, in two forms.

   TC_ATTITUDE_TILT splits the error into the turn of the thrust axis and the turn about it and gives the first its own,
   higher gain (Brescianini and D'Andrea 2018). TC_ATTITUDE_LEE is Lee et al. 2010, kept to reproduce the paper. */
#ifndef GOSHAWK_CONTROLLER_ATTITUDE_H
#define GOSHAWK_CONTROLLER_ATTITUDE_H

#include "goshawk_controller/flatness.h"
#include "goshawk_controller/mixer.h"
#include "goshawk_controller/parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Torque in body axes, modelled moments of the airframe not yet taken off. */
/* `axes`: the body's x, y, z axes in world coordinates, one a row; `feed_rate` and `feed_acceleration`: how the
   reference turns, in body axes. */
void tc_attitude_step(const tc_parameters* parameters, const tc_flatness_state* reference, const float q_world_body[4],
                      float axes[3][3], const float rate_body_rad_s[3], const float feed_rate[3],
                      const float feed_acceleration[3], float torque_body_n_m[3]);

/* Against the moments that the model knows: flapping, damping, rotor drag at hubs that turn. */
void tc_opposing_moments(const tc_parameters* parameters, const tc_mixer* mixer, const float air_velocity_body_m_s[3],
                         const float rate_body_rad_s[3], const float rotor_speed_rad_s[TC_ROTORS],
                         float torque_body_n_m[3]);

/* Whether there are any. */
bool tc_has_moments(const tc_parameters* parameters);

#ifdef __cplusplus
}
#endif

#endif

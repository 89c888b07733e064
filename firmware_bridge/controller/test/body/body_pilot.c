/* Velocity to tilt, tilt to torque, torque to squared speeds about the hover speed: enough to carry the body around. */
#include "body_pilot.h"

#include <math.h>

void body_pilot(const body* b, const double velocity_m_s[3], double speed_rad_s[BODY_ROTORS]) {
    const body_vehicle* v = &b->vehicle;
    double wanted[3], wanted_body[3];
    for (int k = 0; k < 3; k++) {
        wanted[k] = fmax(-5.0, fmin(5.0, 2.5 * (velocity_m_s[k] - b->velocity_m_s[k])));
    }
    wanted[2] += v->gravity_m_s2;
    body_to_body(b->q, wanted, wanted_body);
    const double thrust_n = v->mass_kg * fmax(wanted_body[2], 1.0);
    const double torque_x = v->inertia_kg_m2[0] * (-100.0 * wanted_body[1] / wanted_body[2] - 18.0 * b->rate_rad_s[0]);
    const double torque_y = v->inertia_kg_m2[1] * (100.0 * wanted_body[0] / wanted_body[2] - 18.0 * b->rate_rad_s[1]);
    const double torque_z = v->inertia_kg_m2[2] * -5.0 * b->rate_rad_s[2];
    const double per_square = 0.25 * v->mass_kg * v->gravity_m_s2 / (951.0 * 951.0);
    for (int i = 0; i < BODY_ROTORS; i++) {
        const double n_thrust = 0.25 * thrust_n + 0.25 * torque_x / v->rotor_y_m[i] - 0.25 * torque_y / v->rotor_x_m[i];
        const double square = n_thrust / per_square + 0.25 * v->spin[i] * torque_z / v->cq_n_m_s2;
        speed_rad_s[i] = sqrt(fmax(square, 250.0 * 250.0));
    }
}

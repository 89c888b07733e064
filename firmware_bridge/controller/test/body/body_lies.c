/* What a sensor says instead of the truth. */
#include "body_lies.h"

#include <string.h>

void body_lie(body_sensors* s, const body_fault* fault) {
    const double* value = fault->value;
    switch ((body_fault_kind)fault->kind) {
        case BODY_POSE_AGE:
            s->pose_age_s = value[0];
            break;
        case BODY_HEADING_JUMP:
            s->heading_rad += value[0];
            break;
        case BODY_GYRO_AXIS:
            s->bad_axis = (int32_t)value[0];
            break;
        case BODY_ROTOR_SPEED:
            s->bad_rotor = (int32_t)value[0];
            s->rotor_rad_s = value[1];
            break;
        case BODY_STUCK:
            s->stuck = true;
            break;
        case BODY_VIBRATION:
            s->config.vibration_m_s2 = value[0];
            break;
        case BODY_SPEED_WRONG:
            memcpy(s->velocity_error_m_s, value, sizeof s->velocity_error_m_s);
            break;
        default:
            break;
    }
}

void body_lie_ends(body_sensors* s, const body_sensors_config* normal, int32_t kind) {
    switch ((body_fault_kind)kind) {
        case BODY_POSE_AGE:
            s->pose_age_s = 0.0;
            break;
        case BODY_GYRO_AXIS:
            s->bad_axis = -1;
            break;
        case BODY_ROTOR_SPEED:
            s->bad_rotor = -1;
            break;
        case BODY_STUCK:
            s->stuck = false;
            break;
        case BODY_VIBRATION:
            s->config.vibration_m_s2 = normal->vibration_m_s2;
            break;
        case BODY_SPEED_WRONG:
            memset(s->velocity_error_m_s, 0, sizeof s->velocity_error_m_s);
            break;
        default:
            break;
    }
}

void body_carry(body* b, const double hand[4], double step_s) {
    const double turn[3] = {step_s * hand[3], 0.0, 0.0};
    double change[3];
    for (int k = 0; k < 3; k++) {
        change[k] = (hand[k] - b->velocity_m_s[k]) / step_s + (k == 2 ? b->vehicle.gravity_m_s2 : 0.0);
        b->velocity_m_s[k] = hand[k];
        b->position_m[k] += step_s * hand[k];
        b->rate_rad_s[k] = k == 0 ? hand[3] : 0.0;
    }
    body_turn(b->q, turn, b->q);
    body_to_body(b->q, change, b->specific_force_m_s2);
    memset(b->rotor_rad_s, 0, sizeof b->rotor_rad_s);
    b->record.time_s += step_s;
}

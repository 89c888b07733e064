/* The three functions that a firmware adds; docs/firmware/c_integration.md explains them. `mine` is your estimator's.
 */
#include <string.h>

#include "goshawk_controller/goshawk_controller.h"
#include "goshawk_controller/link.h"

static tc_controller controller;
static tc_link link;  // link_config stays yours, and stays where it is

void setup(void) {
    tc_parameters parameters;
    tc_init(&controller);
    tc_parameters_default(&parameters);  // or from flash, or from the ground
    parameters.mass_kg = 0.70f;
    const tc_reason reason = tc_parameters_set(&controller, &parameters);
    if (reason != TC_OK) halt(tc_reason_text(reason));
    tc_link_init(&link, &controller, &link_config, now_us());
}

static tc_estimate read_estimator(void) {  // world z up, body x forward y left z up, SI
    tc_estimate e = {0};
    e.position_time_us = e.attitude_time_us = mine.pose_time_us;  // when it was true, not when it came
    e.rate_time_us = mine.imu_time_us;
    memcpy(e.position_world_m, mine.position, sizeof e.position_world_m);
    memcpy(e.velocity_world_m_s, mine.velocity, sizeof e.velocity_world_m_s);
    memcpy(e.q_world_body, mine.q, sizeof e.q_world_body);
    memcpy(e.rate_body_rad_s, mine.rate, sizeof e.rate_body_rad_s);
    memcpy(e.specific_force_body_m_s2, mine.acceleration, sizeof e.specific_force_body_m_s2);
    e.position_std_m[0] = e.position_std_m[1] = mine.position_std;
    e.velocity_std_m_s[0] = e.velocity_std_m_s[1] = mine.velocity_std;
    e.battery_v = mine.voltage;
    e.reset_counter = mine.resets;  // one more with every relocalization, and by how much:
    memcpy(e.reset_position_world_m, mine.shift, sizeof e.reset_position_world_m);
    e.valid = TC_VALID_ATTITUDE | TC_VALID_RATE | TC_VALID_SPECIFIC_FORCE;
    if (mine.has_position) e.valid = TC_VALID_ALL;
    return e;
}

void control_task(void) {  // 200 Hz .. 4 kHz
    const tc_estimate estimate = read_estimator();
    tc_output output;
    (void)tc_tick(&controller, now_us(), &estimate, &output);
    if (output.in_command) write_rotor_speeds(output.rotor_speed_rad_s);
    tc_link_update(&link, now_us());
}

void link_task(void) {                                     // same thread, or under the same lock
    tc_link_receive(&link, bytes, count, NULL, now_us());  // a datagram; a serial port hands in its tc_parser
    while ((count = tc_link_transmit(&link, frame, now_us())) > 0) send(frame, count);
}

/* One vehicle with a link, and two stations that talk to it: what the case files of the link share. */
#ifndef LINK_CASES_H
#define LINK_CASES_H

#include "../cases.h"
#include "goshawk_dialect.h"

#define ME 1u /* the vehicle */
#define PILOT 255u
#define OTHER 200u
#define TO_VEHICLE .target_system = ME, .target_component = ME

extern tc_controller controller;
extern tc_link ln;
extern tc_trajectory plan;
extern uint64_t clock_us; /* of the link */
extern tc_link_config link_config;

/* A vehicle on the ground, without a trajectory, with the short plan at hand. */
void start_link(bool sign, unsigned records);
void deliver(uint8_t system, uint8_t component, unsigned message, const uint8_t* payload, unsigned length);
/* Everything the vehicle has to send now; the payload of the last message with this id, or NULL. */
const uint8_t* answer(uint32_t id);
void lease(uint8_t system, uint8_t action);

/* Updates, a millisecond each. */
void update(unsigned times);

/* Uploads and activates the short plan. */
void activate(void);
void upload_cases(void);
void admission_cases(void);
/* An order by a station; the reason that the vehicle answers. */
uint8_t send_order(uint8_t system, uint32_t request, uint8_t command, float value, uint32_t id, uint32_t crc32);
void link_time_cases(void);
void link_corner_cases(void);
/* The present parameters, by a station: all groups; the commit. What the vehicle answers. */
uint8_t stage_parameters(uint8_t system, uint32_t transfer);
uint8_t commit_parameters(uint8_t system, uint32_t transfer, uint32_t crc32);

/* Sends a message of the dialect to the vehicle. */
#define SEND(system, NAME, name, ...)                                         \
    do {                                                                      \
        uint8_t payload_[TC_PAYLOAD_MAX];                                     \
        const name##_msg m_ = {__VA_ARGS__};                                  \
        name##_encode(&m_, payload_);                                         \
        deliver((uint8_t)(system), 190, NAME##_ROW, payload_, NAME##_LENGTH); \
    } while (0)

#endif

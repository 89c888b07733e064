/* The smallest program that integrates the library: its size on a Cortex-M is what the library takes of the flash.
   With -DWITHOUT_LINK the controller alone. */
#include "goshawk_controller/goshawk_controller.h"
#include "goshawk_controller/link.h"

static tc_controller controller;
volatile uint64_t now_us;
tc_estimate estimate;
tc_output output;

void reset(void);

#ifndef WITHOUT_LINK
static tc_link link;
static tc_link_config config;
static tc_parser stream;
uint8_t port[TC_FRAME_MAX];
#endif

void reset(void) {
    tc_parameters parameters;
    tc_init(&controller);
    tc_parameters_default(&parameters);
    if (tc_parameters_set(&controller, &parameters) != TC_OK) return;
#ifndef WITHOUT_LINK
    tc_link_init(&link, &controller, &config, now_us);
#endif
    for (;;) {
        (void)tc_tick(&controller, now_us, &estimate, &output);
#ifndef WITHOUT_LINK
        tc_link_update(&link, now_us);
        tc_link_receive(&link, port, sizeof port, &stream, now_us);
        (void)tc_link_transmit(&link, port, now_us);
#else
        const tc_trajectory_header header = {.id = 1u};
        static tc_segment segment;
        (void)tc_upload_begin(&controller, &header);
        (void)tc_upload_segment(&controller, 0u, &segment);
        (void)tc_upload_finish(&controller);
        (void)tc_upload_activate(&controller, 1u, 0u);
        (void)tc_do(&controller, TC_COMMAND_ARM, 0.0f);
        tc_ground_alive(&controller, 0u);
#endif
    }
}

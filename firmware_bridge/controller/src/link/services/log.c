/* The on-board log: GOSHAWK_STATE payloads in memory of the integrator. */
#include <string.h>

#include "services.h"

_Static_assert(TC_LINK_RECORD == GOSHAWK_STATE_LENGTH, "a record is the payload of a GOSHAWK_STATE");

uint8_t link_log_start(tc_link* link, uint32_t id) {
    const uint64_t now_us = link->controller->telemetry.time_us;
    const tc_link_config* config = link->config;
    if (config->log == NULL || config->log_records == 0u || config->log_period_us == 0u) {
        return TC_LINK_NO_LOG_MEMORY;
    }
    memset(&link->log, 0, sizeof link->log);
    link_cancel(link, LINK_OUT_LOG_RECORD); /* of the old log nothing is left to send */
    link->log.id = id;
    link->log.running = true;
    link->log.next_us = now_us + config->log_period_us;
    return TC_OK;
}

void link_log_stop(tc_link* link) { link->log.running = false; }

void link_log_update(tc_link* link) {
    tc_link_log* log = &link->log;
    const tc_link_config* config = link->config;
    if (!log->running || !link_is_due(&log->next_us, link->controller->telemetry.time_us, config->log_period_us)) {
        return;
    }
    if (log->records == config->log_records) {
        log->not_stored++;
        return;
    }
    goshawk_state_msg m;
    link_fill_state(link, &m);
    goshawk_state_encode(&m, config->log + (size_t)TC_LINK_RECORD * log->records);
    log->records++;
}

link_encoded link_encode_log_info(tc_link* link, uint8_t* payload) {
    const goshawk_log_info_msg m = {.log_id = link->log.id,
                                    .records = link->log.records,
                                    .capacity = link->config->log_records,
                                    .not_stored = link->log.not_stored,
                                    .period_us = link->config->log_period_us,
                                    .running = link->log.running ? 1u : 0u};
    goshawk_log_info_encode(&m, payload);
    return LINK_ENCODED;
}

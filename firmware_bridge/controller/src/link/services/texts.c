/* Sentences for the pilot: what was refused, what has changed. */
#include "services.h"

enum { SEVERITY_ERROR = 3, SEVERITY_WARNING = 4, SEVERITY_INFO = 6 }; /* MAV_SEVERITY */
static const uint32_t TEXT_US = 200000u; /* least time between texts about limits and warnings */

static const char* reason_text(uint8_t reason) {
    switch (reason) {
        case TC_LINK_NOT_IN_CONTROL:
            return "this station is not in control";
        case TC_LINK_UNSUPPORTED:
            return "not supported";
        default:
            return tc_reason_text((tc_reason)reason);
    }
}

void link_report_refusal(tc_link* link, const char* what, uint8_t reason) {
    link->standard.refusal.what = what;
    link->standard.refusal.reason = reason;
    link_send(link, LINK_OUT_TEXT);
}

static bool in_trouble(uint8_t state) { return state == (uint8_t)TC_EMERGENCY || state == (uint8_t)TC_FAULT; }

/* A reason that nobody has to worry about. */
static bool is_planned(uint8_t reason) {
    return reason == (uint8_t)TC_OK || reason == (uint8_t)TC_COMMANDED || reason == (uint8_t)TC_REACHED ||
           reason == (uint8_t)TC_FINISHED || reason == (uint8_t)TC_STANDING_STILL || reason == (uint8_t)TC_TOUCHDOWN ||
           reason == (uint8_t)TC_ESTIMATE_BACK || reason == (uint8_t)TC_RELEASED || reason == (uint8_t)TC_ENGAGED;
}

static const char* warning_text(uint8_t bit) {
    switch (bit) {
        case TC_WARNING_BATTERY:
            return tc_reason_text(TC_BATTERY_LOW);
        case TC_WARNING_DEAD_RECKONING:
            return tc_reason_text(TC_DEAD_RECKONING);
        case TC_WARNING_CLOCK:
            return tc_reason_text(TC_TIME_WENT_BACK);
        case TC_WARNING_GYRO_ONLY:
            return tc_reason_text(TC_GYRO_ONLY);
        case TC_WARNING_NO_OBSERVER:
            return "no accelerometer, wind is not cancelled";
        default:
            return "unknown warning";
    }
}

static void begin_text(tc_link* link, const char* subject, const char* text, uint8_t severity) {
    link->text.subject = subject;
    link->text.text = text;
    link->text.severity = severity;
    link->text.chunk = 0;
    link->text.next_us = link->clock_us + TEXT_US;
    link->text.id = (uint16_t)(link->text.id < UINT16_MAX ? link->text.id + 1u : 1u);
}

/* The next change that has not been reported: state, then limit of the path rate, then warnings one by one. */
static bool next_text(tc_link* link) {
    const tc_mission* mission = &link->controller->mission;
    const tc_telemetry* t = &link->controller->telemetry;
    tc_link_reported* reported = &link->reported;
    const uint8_t changed = (uint8_t)(reported->warnings ^ t->warnings);
    const bool may_repeat = link->clock_us >= link->text.next_us; /* one that flickers is not reported each time */
    tc_link_refused_order* refusal = &link->standard.refusal;
    if (refusal->what != NULL) {
        begin_text(link, refusal->what, reason_text(refusal->reason), SEVERITY_WARNING);
        refusal->what = NULL;
    } else if (reported->transitions != mission->transitions) {
        const uint8_t calm = is_planned(mission->reason) ? SEVERITY_INFO : SEVERITY_WARNING;
        reported->transitions = mission->transitions;
        begin_text(link, tc_mission_state_text(mission->state), tc_reason_text((tc_reason)mission->reason),
                   in_trouble(mission->state) ? SEVERITY_ERROR : calm);
    } else if (may_repeat && reported->limit_reason != t->limit_reason) {
        const bool over = t->limit_reason == (uint8_t)TC_OK;
        reported->limit_reason = t->limit_reason;
        begin_text(link, "path", over ? "at the rate asked for" : tc_reason_text((tc_reason)t->limit_reason),
                   over ? SEVERITY_INFO : SEVERITY_WARNING);
    } else if (may_repeat && changed != 0u) {
        const uint8_t bit = (uint8_t)(changed & (0u - changed)); /* the lowest */
        const bool over = (t->warnings & bit) == 0u;
        reported->warnings = (uint8_t)(reported->warnings ^ bit);
        begin_text(link, over ? "over" : "warning", warning_text(bit), over ? SEVERITY_INFO : SEVERITY_WARNING);
    } else {
        return false;
    }
    return true;
}

void link_note_changes(tc_link* link) {
    const tc_telemetry* t = &link->controller->telemetry;
    if (link->reported.transitions != link->controller->mission.transitions) {
        link_hurry_status(link);
        link_send(link, LINK_OUT_TEXT);
    }
    if (link->reported.limit_reason != t->limit_reason || link->reported.warnings != t->warnings) {
        link_send(link, LINK_OUT_TEXT);
    }
}

/* One chunk of "subject: text". */
link_encoded link_encode_text(tc_link* link, uint8_t* payload) {
    tc_link_text* text = &link->text;
    if (text->chunk == 0u && !next_text(link)) {
        return LINK_NOTHING;
    }
    const char* parts[] = {text->subject, ": ", text->text};
    statustext_msg m = {.severity = text->severity, .chunk_seq = text->chunk};
    const unsigned first = (unsigned)text->chunk * sizeof m.text;
    unsigned at = 0; /* in the whole text */
    for (unsigned i = 0; i < 3u; i++) {
        for (const char* c = parts[i]; *c != '\0'; c++) {
            if (at >= first && at < first + sizeof m.text) {
                m.text[at - first] = *c;
            }
            at++;
        }
    }
    m.id = at > sizeof m.text ? text->id : 0u;
    text->chunk = at > first + sizeof m.text ? (uint8_t)(text->chunk + 1u) : 0u;
    statustext_encode(&m, payload);
    return LINK_MORE; /* the next chunk, or the next text */
}

/* The corners of codec and state machine that neither flights nor fuzzing are sure to reach, one function each; with
   those of mission_cases.c and link_cases.c. Run by tools/assure.py coverage, which wants every branch taken, and by
   the tests; prints the number of checks, or aborts. */
#include "cases.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "goshawk_dialect.h"

static unsigned checks;

void must(bool holds, const char* what) {
    checks++;
    if (!holds) {
        fprintf(stderr, "violated: %s\n", what);
        abort();
    }
}

/* Every state with every event, and what is neither. */
static void mission_table(void) {
    for (uint8_t state = 0; state <= TC_MISSION_STATE_COUNT; state++) {
        for (uint8_t event = 0; event <= TC_EVENT_COUNT; event++) {
            tc_mission mission;
            tc_mission_init(&mission);
            mission.state = state;
            const tc_reason reason = tc_mission_post(&mission, event, TC_COMMANDED, 5);
            const bool moved = mission.state != state;
            must(reason == TC_OK || reason == TC_WRONG_STATE, "an event is taken or refused");
            must(reason == TC_OK || !moved, "a refused event changes nothing");
            must(mission.transitions == (moved ? 1u : 0u), "transitions are counted");
            must(!moved || (mission.previous_state == state && mission.since_us == 5u), "a transition is noted");
            must(state < TC_MISSION_STATE_COUNT || reason == TC_WRONG_STATE, "no such state");
            must(event < TC_EVENT_COUNT || reason == TC_WRONG_STATE, "no such event");
        }
        must(!tc_mission_on_path(state) || tc_mission_in_air(state), "on the path is in the air");
        must(!tc_mission_in_air(state) || tc_mission_rotors_on(state), "in the air the rotors turn");
        must((strcmp(tc_mission_state_text(state), "unknown") == 0) == (state == TC_MISSION_STATE_COUNT), "words");
    }
    for (uint8_t command = 0; command <= TC_COMMAND_COUNT; command++) {
        must((strcmp(tc_command_text(command), "unknown") == 0) == (command == TC_COMMAND_COUNT), "words");
    }
}

/* All have words that fit. */
static void words_of_reasons(void) {
    for (uint8_t reason = 0; reason < UINT8_MAX; reason++) {
        const char* words = tc_reason_text((tc_reason)reason);
        must(strlen(words) > 0u && strlen(words) <= 50u, "words fit");
    }
    must(strcmp(tc_reason_text(TC_ESTIMATE_STALE), "position is stale") == 0, "one of them");
    must(strcmp(tc_reason_text((tc_reason)78), "unknown reason") == 0, "no reason");
}

static const uint8_t key[TC_KEY_BYTES] = {1, 2, 3};

/* A heartbeat from `system`, signed on `link_id` with this stamp; unsigned when the stamp is 0. */
static size_t heartbeat(uint8_t frame[TC_FRAME_MAX], uint8_t system, uint8_t component, uint8_t link_id,
                        uint64_t stamp_10us) {
    static const heartbeat_msg nothing = {0};
    tc_signing signing;
    heartbeat_encode(&nothing, frame + TC_FRAME_HEADER);
    tc_signing_init(&signing, key, stamp_10us - 1u);
    return tc_frame_build(frame, HEARTBEAT_ROW, HEARTBEAT_LENGTH, 0, system, component,
                          stamp_10us == 0u ? NULL : &signing, link_id);
}

/* A heartbeat with this stamp, found as a frame. */
static void receive(uint8_t bytes[TC_FRAME_MAX], tc_frame* frame, uint8_t system, uint8_t component, uint8_t link_id,
                    uint64_t stamp_10us) {
    const uint8_t* at = bytes;
    size_t n = heartbeat(bytes, system, component, link_id, stamp_10us);
    tc_frame_faults faults = {0};
    must(tc_frame_next(&at, &n, frame, &faults), "a frame is found");
}

static tc_signature judged(tc_signing* signing, uint8_t system, uint8_t component, uint8_t link_id, uint64_t stamp) {
    uint8_t bytes[TC_FRAME_MAX];
    tc_frame frame;
    receive(bytes, &frame, system, component, link_id, stamp);
    const tc_signature screened = tc_signing_screen(signing, &frame);
    if (screened != TC_SIGNATURE_GOOD) return screened;
    if (!tc_signing_verify(signing, &frame)) return TC_SIGNATURE_WRONG;
    tc_signing_accept(signing, &frame);
    return TC_SIGNATURE_GOOD;
}

static bool opened(tc_signing* signing, uint8_t system, uint8_t component, uint8_t link_id, uint64_t stamp,
                   tc_sender keep) {
    uint8_t bytes[TC_FRAME_MAX];
    tc_frame frame;
    receive(bytes, &frame, system, component, link_id, stamp);
    tc_signing_open(signing, &frame, &keep);
    return tc_signing_screen(signing, &frame) == TC_SIGNATURE_REPLAYED; /* open from the next stamp on */
}

static const tc_sender nobody = {0, 0, 0};

/* Stamps: newer, equal, late, too late, forgotten, before the opening. */
static void signing_window(void) {
    static const uint8_t other_key[TC_KEY_BYTES] = {9};
    tc_signing signing, other;
    tc_signing_init(&signing, key, 1000);
    must(judged(&signing, 9, 1, 0, 0) == TC_SIGNATURE_MISSING, "unsigned");
    must(judged(&signing, 9, 1, 0, 200000) == TC_SIGNATURE_UNOPENED, "not opened");
    must(opened(&signing, 9, 1, 0, 200000, nobody) && signing.now_10us == 200000u, "opened; its time is ours");
    must(judged(&signing, 9, 1, 0, 200000) == TC_SIGNATURE_REPLAYED, "the opening again");
    must(judged(&signing, 9, 1, 0, 199999) == TC_SIGNATURE_REPLAYED, "before the opening, though not late");
    must(judged(&signing, 9, 1, 0, 300000) == TC_SIGNATURE_GOOD, "newer");
    must(judged(&signing, 9, 1, 0, 300000) == TC_SIGNATURE_REPLAYED, "twice");
    must(judged(&signing, 9, 1, 0, 299999) == TC_SIGNATURE_GOOD, "overtaken");
    must(judged(&signing, 9, 1, 0, 299999) == TC_SIGNATURE_REPLAYED, "overtaken, twice");
    must(judged(&signing, 9, 1, 0, 300000u - TC_STAMP_LATE_10US + 1u) == TC_SIGNATURE_GOOD, "almost 0.65 s late");
    must(judged(&signing, 9, 1, 0, 300000u - TC_STAMP_LATE_10US) == TC_SIGNATURE_REPLAYED, "later");
    must(judged(&signing, 9, 1, 1, 400000) == TC_SIGNATURE_UNOPENED, "another link is another stream");
    must(judged(&signing, 9, 2, 0, 400000) == TC_SIGNATURE_UNOPENED, "another component");
    must(judged(&signing, 8, 1, 0, 400000) == TC_SIGNATURE_UNOPENED, "another system");
    for (uint64_t i = 1; i <= 2u * TC_RECENT; i++) { /* the oldest is forgotten and becomes the floor */
        must(judged(&signing, 9, 1, 0, 300000u + 2u * i) == TC_SIGNATURE_GOOD, "later");
    }
    must(judged(&signing, 9, 1, 0, 300001u) == TC_SIGNATURE_REPLAYED, "older than all that are remembered");
    must(judged(&signing, 9, 1, 0, 300000u + 2u * (TC_RECENT + 2u)) == TC_SIGNATURE_REPLAYED, "remembered");
    must(judged(&signing, 9, 1, 0, 300001u + 2u * (TC_RECENT + 2u)) == TC_SIGNATURE_GOOD, "between those");
    must(judged(&signing, 9, 1, 0, (uint64_t)1 << 47) == TC_SIGNATURE_GOOD, "far ahead");
    must(judged(&signing, 9, 1, 0, 300002u + 4u * TC_RECENT) == TC_SIGNATURE_REPLAYED, "then all that is older");
    tc_signing_init(&other, other_key, 1000);
    must(opened(&other, 9, 1, 0, 100, nobody) && judged(&other, 9, 1, 0, 200) == TC_SIGNATURE_WRONG, "another key");
}

/* No room: the stream unused for longest makes it, but never the one in control. */
static void signing_streams(void) {
    tc_signing signing;
    const tc_sender keep = {10, 1, 0};
    tc_signing_init(&signing, key, 1000);
    for (uint8_t i = 0; i < TC_STREAMS; i++) must(opened(&signing, (uint8_t)(10u + i), 1, 0, 5000, keep), "room");
    must(opened(&signing, 50, 1, 0, 5000, keep), "room is made");
    must(judged(&signing, 10, 1, 0, 6000) == TC_SIGNATURE_GOOD, "not by the one in control");
    must(judged(&signing, 11, 1, 0, 6000) == TC_SIGNATURE_UNOPENED, "by the one unused for longest");
    must(judged(&signing, 12, 1, 0, 6000) == TC_SIGNATURE_GOOD, "the others stay");
    must(opened(&signing, 11, 1, 0, 7000, keep) && judged(&signing, 13, 1, 0, 8000) == TC_SIGNATURE_UNOPENED, "next");
    must(judged(&signing, 11, 1, 0, 6500) == TC_SIGNATURE_REPLAYED, "opened anew: what was before is refused");
    tc_signing_init(&signing, key, 1000);
    for (uint8_t i = 0; i < TC_STREAMS; i++) must(opened(&signing, 10, 1, i, 5000, keep), "four links of one station");
    must(opened(&signing, 11, 1, 0, 5000, keep), "of which one is in control: there is room");
    must(judged(&signing, 10, 1, 0, 6000) == TC_SIGNATURE_GOOD, "not by that one");
    must(judged(&signing, 10, 1, 1, 6000) == TC_SIGNATURE_UNOPENED, "by the next");
}

/* A frame of any length claim, any flags, any id, in any cut; in a stream and in a datagram. */
static void parser_corners(void) {
    uint8_t good[TC_FRAME_MAX];
    tc_frame_faults faults = {0};
    tc_frame frame;
    const size_t length = heartbeat(good, 9, 1, 0, 77);
    for (size_t cut = 0; cut <= length; cut++) {
        tc_parser parser;
        memset(&parser, 0, sizeof parser);
        const uint8_t* at = good;
        size_t n = cut;
        const bool first = tc_parser_next(&parser, &at, &n, &frame, &faults);
        must(first == (cut == length), "only a whole frame is one");
        n = length - cut;
        must(first || tc_parser_next(&parser, &at, &n, &frame, &faults), "the rest completes it");
        must(frame.length == length && memcmp(frame.raw, good, length) == 0, "as it came");
        must(!tc_parser_next(&parser, &at, &n, &frame, &faults) && n == 0u, "and that was all");
        at = good;
        n = cut;
        must(tc_frame_next(&at, &n, &frame, &faults) == (cut == length), "nor is it in a datagram");
    }
    must(faults.checksum_errors == 0u && faults.unknown == 0u, "nothing was broken");
    for (unsigned position = 0; position < 10u; position++) { /* a damaged header, then good frames */
        uint8_t stream[3u * TC_FRAME_MAX];
        memset(stream, 0, sizeof stream);
        memcpy(stream, good, length);
        stream[position] ^= 0xFFu;
        memcpy(stream + 2u * TC_FRAME_MAX, good, length);
        memcpy(stream + 2u * TC_FRAME_MAX + length, good, length);
        tc_parser parser;
        memset(&parser, 0, sizeof parser);
        const uint8_t* at = stream;
        size_t n = sizeof stream;
        must(tc_parser_next(&parser, &at, &n, &frame, &faults), "the good one is found");
        must(at >= stream + 2u * TC_FRAME_MAX + length, "behind the damaged one");
        must(tc_parser_next(&parser, &at, &n, &frame, &faults), "and its fellow");
        must(!tc_parser_next(&parser, &at, &n, &frame, &faults) && n == 0u, "and no other");
        at = stream;
        n = sizeof stream;
        must(tc_frame_next(&at, &n, &frame, &faults) && frame.raw == stream + 2u * TC_FRAME_MAX, "in a datagram too");
        must(tc_frame_next(&at, &n, &frame, &faults) && !tc_frame_next(&at, &n, &frame, &faults), "two in all");
    }
}

/* Of an all-zero payload one byte remains, and nothing signs it unless asked to. */
static void building(void) {
    uint8_t frame[TC_FRAME_MAX] = {0};
    must(tc_frame_build(frame, HEARTBEAT_ROW, HEARTBEAT_LENGTH, 3, 1, 1, NULL, 0) == 13u, "one byte is left");
    must(frame[1] == 1u && frame[2] == 0u && frame[4] == 3u, "header");
    must(tc_frame_build(frame, HEARTBEAT_ROW, 0, 0, 1, 1, NULL, 0) == 12u, "an empty payload stays empty");
}

static void codec_cases(void) {
    signing_window();
    signing_streams();
    parser_corners();
    building();
}

static void table_cases(void) {
    mission_table();
    words_of_reasons();
}

/* Those whose names are given, in this order; all of them without a name. */
int main(int argc, char** argv) {
    static const struct {
        const char* name;
        void (*run)(void);
    } groups[] = {
        {"tables", table_cases},        {"codec", codec_cases},           {"mixer", mixer_cases},
        {"shaping", shaping_cases},     {"mission", mission_cases},       {"safety", safety_cases},
        {"reaction", reaction_cases},   {"landing", landing_cases},       {"ground", ground_cases},
        {"emergency", emergency_cases}, {"supervisor", supervisor_cases}, {"delay", delay_cases},
        {"link", link_cases},           {"standard", standard_cases},     {"presentation", presentation_cases},
    };
    for (size_t i = 0; i < sizeof groups / sizeof groups[0]; i++) {
        bool wanted = argc == 1;
        for (int a = 1; a < argc; a++) wanted = wanted || strcmp(argv[a], groups[i].name) == 0;
        if (wanted) groups[i].run();
    }
    printf("%u checks\n", checks);
    return 0;
}

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

/* All have words that fit; those of transitions are the same alone. */
static void words_of_reasons(void) {
    for (uint8_t reason = 0; reason < UINT8_MAX; reason++) {
        const char *words = tc_reason_text((tc_reason)reason), *alone = tc_transition_text(reason);
        const bool transition = reason >= TC_ESTIMATE_STALE && reason <= TC_TIMEOUT && reason != TC_NOT_CONFIGURED;
        must(strlen(words) > 0u && strlen(words) <= 50u, "words fit");
        must(strcmp(alone, transition ? words : "") == 0, "transitions have theirs");
        must(!transition || strcmp(words, "unknown reason") != 0, "every one of them");
    }
    must(strcmp(tc_transition_text(TC_ESTIMATE_STALE), "position is stale") == 0, "the first one");
    must(strcmp(tc_transition_text(TC_LINK_LOST), "link is lost") == 0, "one between");
    must(strcmp(tc_reason_text(TC_TIMEOUT), "took too long") == 0, "the last one");
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

static tc_signature judged(tc_signing* signing, uint8_t system, uint8_t component, uint8_t link_id, uint64_t stamp) {
    uint8_t bytes[TC_FRAME_MAX];
    const uint8_t* at = bytes;
    size_t n = heartbeat(bytes, system, component, link_id, stamp);
    tc_frame_faults faults = {0};
    tc_frame frame;
    must(tc_frame_next(&at, &n, &frame, &faults), "a frame is found");
    return tc_signing_check(signing, &frame);
}

/* Stamps: newer, equal, late, too late, forgotten; one stream from another by each of its three numbers. */
static void signing_window(void) {
    tc_signing signing;
    tc_signing_init(&signing, key, 1000);
    must(judged(&signing, 9, 1, 0, 0) == TC_SIGNATURE_MISSING, "unsigned");
    must(judged(&signing, 9, 1, 0, 1000) == TC_SIGNATURE_REPLAYED, "not later than the start");
    must(judged(&signing, 9, 1, 0, 200000) == TC_SIGNATURE_GOOD, "first");
    must(judged(&signing, 9, 1, 0, 200000) == TC_SIGNATURE_REPLAYED, "twice");
    must(judged(&signing, 9, 1, 0, 199999) == TC_SIGNATURE_GOOD, "overtaken");
    must(judged(&signing, 9, 1, 0, 134466) == TC_SIGNATURE_GOOD, "almost 0.65 s late");
    must(judged(&signing, 9, 1, 0, 134465) == TC_SIGNATURE_REPLAYED, "later");
    must(judged(&signing, 9, 1, 0, 1000) == TC_SIGNATURE_REPLAYED, "at the floor");
    must(judged(&signing, 9, 1, 1, 100001) == TC_SIGNATURE_GOOD, "another link is another stream");
    must(judged(&signing, 9, 2, 0, 100001) == TC_SIGNATURE_GOOD, "another component");
    must(judged(&signing, 8, 1, 0, 100001) == TC_SIGNATURE_GOOD, "another system");
    must(judged(&signing, 7, 1, 0, 100001) == TC_SIGNATURE_REPLAYED, "no later than the stream that made room");
    must(judged(&signing, 7, 1, 0, 300000) == TC_SIGNATURE_GOOD, "the most silent one makes room");
    for (uint64_t i = 0; i < 2u * TC_RECENT; i++) { /* in order: the oldest is forgotten and becomes the floor */
        must(judged(&signing, 7, 1, 0, 300001u + i) == TC_SIGNATURE_GOOD, "later");
    }
    must(judged(&signing, 7, 1, 0, 300005) == TC_SIGNATURE_REPLAYED, "forgotten is refused");
    must(judged(&signing, 7, 1, 0, 300031) == TC_SIGNATURE_REPLAYED, "remembered is refused");
    must(judged(&signing, 7, 1, 0, 300032u + 65000u) == TC_SIGNATURE_GOOD, "a leap that all of them stay in reach of");
    must(judged(&signing, 7, 1, 0, 300032) == TC_SIGNATURE_REPLAYED, "remembered still");
    must(judged(&signing, 7, 1, 0, 300032u + 65536u) == TC_SIGNATURE_GOOD, "equal to it in the low half");
    must(judged(&signing, 7, 1, 0, 300032) == TC_SIGNATURE_REPLAYED, "and out of reach now");
    must(judged(&signing, 7, 1, 0, 300033u + 65000u) == TC_SIGNATURE_GOOD, "overtaken, between the two");
    must(judged(&signing, 7, 1, 0, 300032u + 65000u) == TC_SIGNATURE_REPLAYED, "that one was kept");
    must(judged(&signing, 7, 1, 0, 1000000u) == TC_SIGNATURE_GOOD, "a leap that forgets all");
    must(judged(&signing, 7, 1, 0, 1000000u - 65535u) == TC_SIGNATURE_REPLAYED, "refuses what is out of reach");
    must(judged(&signing, 7, 1, 0, 1000000u - 65534u) == TC_SIGNATURE_GOOD, "and takes what is not");
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

int main(void) {
    mission_table();
    words_of_reasons();
    signing_window();
    parser_corners();
    building();
    mission_cases();
    link_cases();
    printf("%u checks\n", checks);
    return 0;
}

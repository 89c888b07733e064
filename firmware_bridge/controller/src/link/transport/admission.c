/* Who gets in. The cheap questions come first: the address, then stream and time stamp; then the budget; then the hash.

   A stream opens by a challenge: a PING whose 96 bits (time_usec, seq) are the beginning of a SHA-256 over the key, a
   label, the boot's number and a counter. Whoever returns them, signed, has the key and is here now. An answer opens
   one stream and uses the challenge up; one that nobody answered is replaced after a while, so that an answer that was
   held back cannot be used later. */
#include <string.h>

#include "signing.h"
#include "transport.h"

static const uint8_t label[] = "goshawk challenge";

static void put_u32(uint8_t* bytes, uint32_t value) {
    for (unsigned i = 0; i < 4u; i++) {
        bytes[i] = (uint8_t)(value >> (8u * i));
    }
}

static uint32_t get_u32(const uint8_t* bytes) {
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static void renew_challenge(tc_link* link) {
    tc_link_challenge* challenge = &link->challenge;
    uint8_t numbers[8], digest[32];
    tc_sha256 hash;
    challenge->counter++;
    put_u32(numbers, link->config->boot_id);
    put_u32(numbers + 4, challenge->counter);
    tc_sha256_init(&hash);
    tc_sha256_update(&hash, link->config->key, TC_KEY_BYTES);
    tc_sha256_update(&hash, label, sizeof label);
    tc_sha256_update(&hash, numbers, sizeof numbers);
    tc_sha256_final(&hash, digest);
    challenge->time_usec = (uint64_t)get_u32(digest) | ((uint64_t)get_u32(digest + 4) << 32);
    challenge->seq = get_u32(digest + 8);
    challenge->issued_us = link->clock_us;
    challenge->quiet_us = 0;
    link->random = get_u32(digest + 12) | 1u; /* not sent, and not zero */
}

void link_admission_init(tc_link* link) { renew_challenge(link); }

/* Has a challenge sent, unless one has been just now. A challenge is sent for half of its time only, so that there is
   time to answer. Whether it was. */
static bool send_challenge(tc_link* link) {
    tc_link_challenge* challenge = &link->challenge;
    if (link->clock_us < challenge->next_us) {
        return false;
    }
    if (link->clock_us - challenge->issued_us >= TC_LINK_ANSWER_US / 2u) {
        renew_challenge(link);
    }
    challenge->next_us = link->clock_us + TC_LINK_CHALLENGE_US;
    challenge->quiet_us = link->clock_us + TC_LINK_QUIET_US;
    link_send(link, LINK_OUT_CHALLENGE);
    return true;
}

static bool answers_challenge(const tc_link* link, const tc_frame* frame) {
    const tc_link_challenge* challenge = &link->challenge;
    if (frame->message != (uint8_t)PING_ROW || link->clock_us - challenge->issued_us >= TC_LINK_ANSWER_US) {
        return false;
    }
    ping_msg m;
    ping_decode(&m, frame->raw + TC_FRAME_HEADER, frame->raw[TC_FRAME_LENGTH]);
    return m.target_system == link->config->system_id && m.target_component == link->config->component_id &&
           m.time_usec == challenge->time_usec && m.seq == challenge->seq;
}

static uint8_t payload_byte(const tc_frame* frame, unsigned at) {
    return at < frame->raw[TC_FRAME_LENGTH] ? frame->raw[TC_FRAME_HEADER + at] : 0u;
}

static bool is_for_us(const tc_link* link, const tc_frame* frame) {
    const tc_link_config* config = link->config;
    const uint8_t from = frame->raw[TC_FRAME_SYSTEM];
    const uint8_t system = payload_byte(frame, frame->target_at); /* 0, to all, where there is none */
    const uint8_t component = payload_byte(frame, frame->target_at + 1u);
    return from != 0u && from != config->system_id && (system == 0u || system == config->system_id) &&
           (component == 0u || component == config->component_id);
}

/* Whether `per_s` leaves something now. */
static bool spend(tc_link_budget* budget, uint64_t now_us, uint32_t per_s) {
    if (budget->next_us > now_us + TC_LINK_RESERVE_US) {
        return false;
    }
    budget->next_us = (budget->next_us > now_us ? budget->next_us : now_us) + 1000000u / per_s;
    return true;
}

/* The station in control spends of its own. */
static bool may_check(tc_link* link, const tc_frame* frame) {
    const uint32_t asked = link->config->signature_checks_per_s;
    const uint32_t per_s = asked != 0u ? asked : TC_LINK_CHECKS_PER_S;
    return link_is_holder_stream(link, link_sender(frame))
               ? spend(&link->holder_checks, link->clock_us, per_s)
               : spend(&link->other_checks, link->clock_us, per_s / 4u + 1u);
}

/* xorshift32 (Marsaglia 2003), from a seed that is secret. */
static uint32_t draw(tc_link* link) {
    link->random ^= link->random << 13;
    link->random ^= link->random >> 17;
    link->random ^= link->random << 5;
    return link->random;
}

/* Keeps one of the frames without budget, each with the same probability: the n-th takes the place with 1 / n. */
static void enter_lottery(tc_link* link, const tc_frame* frame) {
    tc_link_lottery* lottery = &link->lottery;
    lottery->candidates++;
    if (lottery->candidates > 1u) {
        link->counts.over_budget++; /* the one that was kept, or this one */
    }
    if (draw(link) % lottery->candidates == 0u) {
        memcpy(lottery->bytes, frame->raw, frame->length);
        lottery->frame = *frame;
        lottery->frame.raw = lottery->bytes;
    }
}

/* A station whose stream is not open. It is challenged. Where its stamp is later than ours, as when we have lost ours
   over a restart, we follow it, so that it will accept what we send; that opens nothing. */
static void challenge_station(tc_link* link, const tc_frame* frame) {
    link->counts.unopened++;
    const uint64_t stamp_10us = tc_frame_stamp_10us(frame);
    if (send_challenge(link) && stamp_10us > link->signing.now_10us && tc_signing_verify(&link->signing, frame)) {
        link->signing.now_10us = stamp_10us;
    }
}

/* A frame whose signature may be checked now. */
static bool check(tc_link* link, const tc_frame* frame, bool opens) {
    if (!tc_signing_verify(&link->signing, frame)) {
        link->counts.wrong_key++;
        return false;
    }
    if (opens) {
        const tc_link_station holder = link->lease.holder;
        const tc_sender keep = {holder.system_id, holder.component_id, holder.link_id};
        tc_signing_open(&link->signing, frame, &keep);
        renew_challenge(link); /* this one is used up */
    } else {
        tc_signing_accept(&link->signing, frame);
    }
    link->counts.accepted++;
    return true;
}

/* What is left of a frame that is for us: its signature. `free`: the budget is not asked. */
static bool judge(tc_link* link, const tc_frame* frame, bool free) {
    const tc_signature screened = tc_signing_screen(&link->signing, frame);
    const bool opens = screened == TC_SIGNATURE_UNOPENED && answers_challenge(link, frame);
    if (screened == TC_SIGNATURE_MISSING) {
        link->counts.without_signature += frame->message == (uint8_t)HEARTBEAT_ROW ? 0u : 1u;
    } else if (screened == TC_SIGNATURE_REPLAYED) {
        link->counts.replayed++;
    } else if (screened == TC_SIGNATURE_UNOPENED && !opens) {
        challenge_station(link, frame);
    } else if (free || may_check(link, frame)) {
        return check(link, frame, opens);
    } else {
        enter_lottery(link, frame);
    }
    return false;
}

bool link_admit(tc_link* link, const tc_frame* frame) {
    if (!is_for_us(link, frame)) {
        link->counts.not_for_us++;
        return false;
    }
    if (link->config->sign) {
        return judge(link, frame, false);
    }
    link->counts.accepted++;
    return true;
}

const tc_frame* link_draw_lottery(tc_link* link) {
    if (link->lottery.candidates == 0u) {
        return NULL;
    }
    link->lottery.candidates = 0;
    return judge(link, &link->lottery.frame, true) ? &link->lottery.frame : NULL;
}

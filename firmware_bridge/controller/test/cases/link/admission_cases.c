/* Who gets in: challenges, recordings, floods. The vehicle signs; its stations have its key or another. */
#include <string.h>

#include "link_cases.h"

static const uint8_t vehicle_key[TC_KEY_BYTES] = {0}, wrong_key[TC_KEY_BYTES] = {1};

typedef struct {
    uint8_t system_id, link_id;
    tc_signing signing;
} station;

typedef struct {
    uint8_t bytes[TC_FRAME_MAX];
    size_t length;
} recording;

static station station_of(uint8_t system_id, const uint8_t* key, uint64_t clock_10us) {
    station s = {.system_id = system_id};
    tc_signing_init(&s.signing, key, clock_10us);
    return s;
}

/* A signed frame, as it would travel. */
#define MAKE(out, s, NAME, name, ...)                                                                                  \
    do {                                                                                                               \
        const name##_msg m_ = {__VA_ARGS__};                                                                           \
        name##_encode(&m_, (out)->bytes + TC_FRAME_HEADER);                                                            \
        (out)->length = tc_frame_build((out)->bytes, NAME##_ROW, NAME##_LENGTH, 0, (s)->system_id, 190, &(s)->signing, \
                                       (s)->link_id);                                                                  \
    } while (0)

static void receive(const recording* r) { tc_link_receive(&ln, r->bytes, r->length, NULL, clock_us); }

static void heartbeat(station* s) {
    recording r;
    MAKE(&r, s, HEARTBEAT, heartbeat, .type = 6);
    receive(&r);
}

static void signed_lease(station* s, uint8_t action) {
    recording r;
    MAKE(&r, s, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .action = action);
    receive(&r);
}

/* The challenge that the vehicle sends now; false when it sends none. */
static bool challenge(ping_msg* m) {
    const uint8_t* payload = answer(PING_ID);
    if (payload != NULL) ping_decode(m, payload, PING_LENGTH);
    return payload != NULL;
}

static recording challenge_answer(station* s, const ping_msg* m) {
    recording r;
    MAKE(&r, s, PING, ping, TO_VEHICLE, .time_usec = m->time_usec, .seq = m->seq);
    return r;
}

/* A frame in vain, the challenge, its answer. */
static void open_stream(station* s) {
    ping_msg m;
    clock_us += TC_LINK_CHALLENGE_US;
    heartbeat(s);
    must(challenge(&m), "a station that is not known is challenged");
    const recording r = challenge_answer(s, &m);
    const uint32_t accepted = ln.counts.accepted;
    receive(&r);
    must(ln.counts.accepted == accepted + 1u, "and its answer lets it in");
}

/* A vehicle that signs, and could be armed. */
static void boot(uint32_t boot_id, uint64_t start_10us) {
    const trouble none = {0};
    uint64_t now;
    start_link(true, 4);
    link_config.boot_id = boot_id;
    link_config.start_10us = start_10us;
    set_out(&controller, &now, 0, TC_DISARMED);
    (void)run(&controller, &now, 0.2f, &none);
    tc_link_init(&ln, &controller, &link_config, clock_us);
}

/* The attack: all of a flight's frames, recorded, sent again after a restart. The station's clock is ahead of the
   vehicle's, so that each of the stamps is later than all that the restarted vehicle knows. */
static void recorded_flights(void) {
    static recording session[28];
    const uint64_t restarts_10us[] = {1000000u, 90000000u};
    boot(1, 1000000u);
    station pilot = station_of(PILOT, vehicle_key, 50000000u);
    ping_msg first = {0};
    heartbeat(&pilot);
    must(challenge(&first), "challenged");
    session[0] = challenge_answer(&pilot, &first);
    for (uint8_t i = 1; i < 26u; i++) {
        MAKE(&session[i], &pilot, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, TO_VEHICLE, .nonce = i, .action = 1);
    }
    MAKE(&session[26], &pilot, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = 26,
         .command = TC_COMMAND_ARM);
    MAKE(&session[27], &pilot, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = 27,
         .command = TC_COMMAND_TAKE_OFF, .value = 1.5f);
    for (unsigned i = 0; i < 28u; i++) {
        clock_us += 10000u;
        receive(&session[i]);
    }
    must(ln.counts.accepted == 28u && controller.mission.state == TC_TAKE_OFF, "live, all of them count");
    for (unsigned i = 0; i < 28u; i++) receive(&session[i]);
    must(ln.counts.accepted == 28u && ln.counts.replayed == 28u, "again, none does");
    for (unsigned i = 0; i < 2u; i++) {
        boot(2u + i, restarts_10us[i]);
        for (unsigned j = 0; j < 3u * 28u; j++) {
            clock_us += 10000u;
            receive(&session[j % 28u]);
            (void)answer(0);
        }
        must(ln.counts.accepted == 0u && ln.counts.unopened == 3u * 28u, "after a restart none does");
        must(controller.mission.state == TC_DISARMED && ln.lease.holder.system_id == 0u, "nothing is armed");
        open_stream(&pilot);
        for (unsigned j = 0; j < 28u; j++) receive(&session[j]);
        must(ln.counts.accepted == 1u, "nor when the station is there itself");
        signed_lease(&pilot, 1);
        must(ln.lease.holder.system_id == PILOT, "whose next frame counts");
    }
}

/* What is an answer to a challenge, and what is not. */
static void challenges(void) {
    ping_msg m = {0}, other = {0};
    recording r;
    boot(7, 1000);
    station pilot = station_of(PILOT, vehicle_key, 2000), stranger = station_of(9, wrong_key, 2000);
    signed_lease(&pilot, 1);
    must(challenge(&m) && ln.counts.unopened == 1u, "challenged");
    must(m.target_system == 0u && m.target_component == 0u, "as a request to all, which MAVLink's stations answer");
    heartbeat(&pilot);
    must(!challenge(&other), "one challenge at a time");
    clock_us += TC_LINK_CHALLENGE_US;
    heartbeat(&pilot);
    must(challenge(&other) && other.time_usec == m.time_usec && other.seq == m.seq, "the same until it is answered");
    MAKE(&r, &pilot, PING, ping, TO_VEHICLE, .time_usec = m.time_usec, .seq = m.seq ^ 1u);
    receive(&r);
    MAKE(&r, &pilot, PING, ping, TO_VEHICLE, .time_usec = m.time_usec ^ ((uint64_t)1 << 63), .seq = m.seq);
    receive(&r);
    MAKE(&r, &pilot, PING, ping, .time_usec = m.time_usec, .seq = m.seq);
    receive(&r);
    MAKE(&r, &pilot, PING, ping, .target_component = ME, .time_usec = m.time_usec, .seq = m.seq);
    receive(&r);
    MAKE(&r, &pilot, PING, ping, .target_system = ME, .time_usec = m.time_usec, .seq = m.seq);
    receive(&r);
    MAKE(&r, &pilot, TIMESYNC, timesync, .ts1 = (int64_t)m.time_usec);
    receive(&r);
    must(ln.counts.accepted == 0u, "another number, another receiver, another message");
    r = challenge_answer(&stranger, &m);
    receive(&r);
    must(ln.counts.accepted == 0u && ln.counts.wrong_key == 1u, "another key");
    const recording late = challenge_answer(&pilot, &m);
    for (unsigned i = 0; i < 100u; i++) update(100);
    receive(&late);
    must(ln.counts.accepted == 0u, "an answer that was held back for ten seconds");
    clock_us += TC_LINK_CHALLENGE_US;
    heartbeat(&pilot);
    must(challenge(&other) && other.time_usec != m.time_usec, "a new challenge");
    const recording right = challenge_answer(&pilot, &other);
    station twin = pilot;
    twin.link_id = 5;
    const recording second = challenge_answer(&twin, &other);
    receive(&right);
    must(ln.counts.accepted == 1u, "answered");
    receive(&right);
    receive(&second);
    must(ln.counts.accepted == 1u, "once, by one stream");
    must(ln.counts.replayed == 1u, "as a frame of an open stream it is a replay");
    boot(8, 1000);
    heartbeat(&pilot);
    must(challenge(&m) && m.time_usec != other.time_usec, "another boot, another challenge");
    boot(8, 1000);
    heartbeat(&pilot);
    must(challenge(&other) && m.time_usec == other.time_usec, "the same boot id, the same: it must not repeat");
}

/* A stamp kept over restarts; one that was lost. */
static void kept_stamps(void) {
    ping_msg m;
    boot(1, 1000);
    station pilot = station_of(PILOT, vehicle_key, 700000000u);
    open_stream(&pilot);
    const uint64_t kept_10us = tc_link_stamp_to_keep(&ln);
    must(kept_10us >= pilot.signing.now_10us + 100000u * TC_LINK_KEEP_PERIOD_S + TC_STAMP_LATE_10US, "it lies ahead");
    for (unsigned i = 0; i < TC_LINK_KEEP_PERIOD_S; i++) {
        uint8_t frame[TC_FRAME_MAX];
        clock_us += 1000000u;
        while (tc_link_transmit(&ln, frame, clock_us) > 0u) clock_us++;
    }
    must(ln.signing.now_10us < kept_10us, "of all stamps until the next time");
    boot(2, 0); /* lost */
    heartbeat(&pilot);
    must(challenge(&m) && ln.signing.now_10us > pilot.signing.now_10us, "it follows the first station that it hears");
    must(ln.counts.accepted == 0u, "which opens nothing");
    boot(3, 0);
    station stranger = station_of(9, wrong_key, 900000000u);
    heartbeat(&stranger);
    must(challenge(&m) && ln.signing.now_10us < 100000u, "but not one with another key");
}

static void flood(station* s, unsigned frames) {
    for (unsigned i = 0; i < frames; i++) heartbeat(s);
}

/* Frames with another key that claim another open stream: they cost no more than their budget, and the station in
   control loses nothing. */
static void flood_from_others(void) {
    boot(1, 1000);
    station pilot = station_of(PILOT, vehicle_key, 2000), guest = station_of(OTHER, vehicle_key, 2000);
    open_stream(&pilot);
    open_stream(&guest);
    signed_lease(&pilot, 1);
    station forger = station_of(OTHER, wrong_key, 3000000), unknown = station_of(77, wrong_key, 3000000);
    const uint32_t before = ln.counts.accepted;
    for (unsigned i = 0; i < 1000u; i++) {
        update(1);
        flood(&forger, 50);
        flood(&unknown, 50);
        heartbeat(&pilot);
        if (i % 500u == 0u) signed_lease(&pilot, 1);
    }
    must(ln.counts.accepted == before + 1002u, "every frame of the station in control counts");
    /* A quarter of the rate, the reserve, one of each update. */
    must(ln.counts.wrong_key <= TC_LINK_CHECKS_PER_S / 4u + 4u + 1000u, "what is checked is bounded");
    must(ln.counts.wrong_key + ln.counts.over_budget + 1u >= 50000u, "what is not checked is counted");
    must(ln.counts.unopened >= 50000u, "who was never let in costs nothing");
    must(ln.lease.holder.system_id == PILOT, "in control all the time");
}

/* Frames with another key that claim to be of the station in control, as many as you like before each of its own: KILL
   gets through all the same. */
static void flood_as_the_holder(void) {
    const trouble none = {0};
    unsigned worst = 0;
    for (uint32_t round = 0; round < 20u; round++) {
        uint64_t now;
        boot(100u + round, 1000);
        station pilot = station_of(PILOT, vehicle_key, 2000);
        open_stream(&pilot);
        signed_lease(&pilot, 1);
        station forger = station_of(PILOT, wrong_key, 3000000);
        set_out(&controller, &now, 0, TC_HOLD);
        flood(&forger, 100);
        unsigned tries = 0;
        while (controller.mission.state == TC_HOLD && tries < 2000u) {
            recording kill;
            tries++;
            if (tries % 20u == 0u) (void)run(&controller, &now, 0.01f, &none);
            flood(&forger, 20); /* always ahead of it in the queue */
            MAKE(&kill, &pilot, GOSHAWK_MISSION_COMMAND, goshawk_mission_command, TO_VEHICLE, .request_id = 5,
                 .command = TC_COMMAND_KILL);
            receive(&kill);
            update(1);
        }
        must(controller.mission.state == TC_FAULT || controller.mission.state == TC_DISARMED, "killed");
        worst = tries > worst ? tries : worst;
    }
    must(worst < 200u, "21 frames an update: one chance in 21 of each, so 200 in vain happen once in 17,000");
}

/* What is refused without a hash costs no budget. */
static void cheap_first(void) {
    boot(1, 1000);
    station pilot = station_of(PILOT, vehicle_key, 2000);
    open_stream(&pilot);
    signed_lease(&pilot, 1);
    recording old, foreign, fresh;
    MAKE(&old, &pilot, HEARTBEAT, heartbeat, .type = 6);
    receive(&old);
    clock_us += 100000u;
    const uint32_t before = ln.counts.accepted;
    for (unsigned i = 0; i < 1000u; i++) receive(&old);
    MAKE(&foreign, &pilot, GOSHAWK_LEASE_REQUEST, goshawk_lease_request, .target_system = 99, .action = 1);
    for (unsigned i = 0; i < 1000u; i++) receive(&foreign);
    for (unsigned i = 0; i < 8u; i++) {
        MAKE(&fresh, &pilot, HEARTBEAT, heartbeat, .type = 6);
        receive(&fresh);
    }
    must(ln.counts.accepted == before + 8u, "the whole reserve is there");
    must(ln.counts.replayed == 1000u && ln.counts.not_for_us == 1000u && ln.counts.over_budget == 0u, "as counted");
    deliver(PILOT, 190, GOSHAWK_LEASE_REQUEST_ROW, (const uint8_t*)"", 1);
    deliver(PILOT, 190, HEARTBEAT_ROW, (const uint8_t*)"", 1);
    must(ln.counts.without_signature == 1u, "unsigned; heartbeats are not counted");
}

/* A station under the id of the one in control, over another link, has all other streams: a third one still finds
   room, and the one in control keeps its own. */
static void room_beside_the_holder(void) {
    boot(1, 1000);
    station pilot = station_of(PILOT, vehicle_key, 2000), guest = station_of(OTHER, vehicle_key, 2000);
    for (pilot.link_id = 0; pilot.link_id < TC_STREAMS; pilot.link_id++) {
        open_stream(&pilot);
        if (pilot.link_id == 0u) signed_lease(&pilot, 1);
    }
    pilot.link_id = 1;
    signed_lease(&pilot, 1);
    must(ln.lease.holder.link_id == 0u, "the same id over another link is another station");
    open_stream(&guest);
    pilot.link_id = 0;
    clock_us += 1000u;
    signed_lease(&pilot, 1);
    must(ln.lease.until_us == ln.clock_us + TC_LINK_LEASE_US, "and the stream in control stays open");
}

/* How many signatures a second are checked is the integrator's choice. */
static void budget_of_choice(void) {
    boot(1, 1000);
    link_config.signature_checks_per_s = 10u * TC_LINK_CHECKS_PER_S;
    station pilot = station_of(PILOT, vehicle_key, 2000), forger = station_of(PILOT, wrong_key, 3000000);
    open_stream(&pilot);
    signed_lease(&pilot, 1);
    const uint32_t before = ln.counts.wrong_key;
    for (unsigned i = 0; i < 1000u; i++) {
        update(1);
        flood(&forger, 20);
    }
    const uint32_t checked = ln.counts.wrong_key - before;
    must(checked > 9u * TC_LINK_CHECKS_PER_S && checked <= 10u * TC_LINK_CHECKS_PER_S + 1100u, "as many as asked for");
}

void admission_cases(void) {
    recorded_flights();
    challenges();
    kept_stamps();
    flood_from_others();
    flood_as_the_holder();
    cheap_first();
    room_beside_the_holder();
    budget_of_choice();
}

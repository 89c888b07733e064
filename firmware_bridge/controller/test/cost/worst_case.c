/* Worst counts of every public function of the controller, on a bare Cortex-M under QEMU (mps2-an386: M4F). With
   `-icount shift=6,sleep=off` an instruction takes 64 ns of emulated time; SysTick counts that time in steps of 40 ns,
   so a difference of two readings is an exact number of instructions. Prints "count name" a line, by semihosting.

   target_main.c calls driver_run; here it goes through states and situations instead of flying one mission. */
#include "worst_case.h"

#include <string.h>

#include "../driver/driver.h"
#include "goshawk_controller/goshawk_controller.h"

#define ROWS 160u
#define STEP_US 2500u
#define NS_PER_COUNT 40u       /* SysTick at 25 MHz */
#define NS_PER_INSTRUCTION 64u /* -icount shift=6 */

static struct {
    char name[64];
    uint32_t worst;
} row[ROWS];
static unsigned rows;
static uint32_t overhead, began;

static volatile uint32_t* const systick = (volatile uint32_t*)0xe000e010u; /* control, reload, value */

void count_begin(void) { began = systick[2]; }

static uint32_t count_since(void) {
    const uint32_t counts = (began - systick[2]) & 0xffffffu;
    return (counts * NS_PER_COUNT + NS_PER_INSTRUCTION / 2u) / NS_PER_INSTRUCTION;
}

/* "a", or "a: b". Longer names are cut. */
static void join(char out[64], const char* a, const char* between, const char* b) {
    size_t n = 0;
    const char* part[] = {a, b[0] == '\0' ? "" : between, b};
    for (int i = 0; i < 3; i++) {
        for (const char* at = part[i]; *at != '\0' && n < 63u; at++) out[n++] = *at;
    }
    out[n] = '\0';
}

void count_end(const char* name, const char* situation) {
    const uint32_t count = count_since() - overhead;
    char whole[sizeof row[0].name];
    join(whole, name, ": ", situation);
    unsigned i = 0;
    while (i < rows && strcmp(row[i].name, whole) != 0) i++;
    if (i == rows && rows < ROWS) memcpy(row[rows++].name, whole, sizeof whole);
    if (i < ROWS && count > row[i].worst) row[i].worst = count;
}

static void print(const char* text) {
    register uint32_t r0 __asm__("r0") = 0x04u; /* SYS_WRITE0 */
    register const char* r1 __asm__("r1") = text;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void print_rows(void) {
    for (unsigned i = 0; i < rows; i++) {
        char digits[] = "0000000000 ";
        uint32_t left = row[i].worst;
        for (int at = 9; at >= 0; at--, left /= 10u) digits[at] = (char)('0' + left % 10u);
        print(digits);
        print(row[i].name);
        print("\n");
    }
}

/* -- a vehicle that follows its set-point, and can be disturbed ---------------------------------------------------- */

static tc_controller c;
static tc_estimate e;
static uint64_t now_us;
static uint32_t random_state = 1u;
static const char* situation;
static bool frozen_position, frozen_attitude;
static float jump_m_s, spin_rad_s, tilt_rad_s; /* noise of velocity, yaw rate, roll rate */

static float noise(float size) {
    random_state = random_state * 1664525u + 1013904223u;
    return size * ((float)(int32_t)(random_state >> 8) * (1.0f / 8388608.0f) - 1.0f);
}

static void tick(void) {
    static char name[64];
    tc_output output;
    const tc_telemetry* t = tc_telemetry_now(&c);
    now_us += STEP_US;
    if (tc_mission_in_air(t->state)) {
        memcpy(e.position_world_m, t->setpoint.position_world_m, sizeof e.position_world_m);
        memcpy(e.velocity_world_m_s, t->setpoint.velocity_world_m_s, sizeof e.velocity_world_m_s);
        memcpy(e.q_world_body, t->flatness.q_reference, sizeof e.q_world_body);
        e.specific_force_body_m_s2[2] = t->wrench.thrust_n / c.parameters.mass_kg;
    }
    for (int i = 0; i < 3; i++) {
        e.position_world_m[i] += noise(0.005f);
        e.velocity_world_m_s[i] += noise(0.02f + jump_m_s);
        e.rate_body_rad_s[i] = noise(0.05f + (i == 2 ? spin_rad_s : tilt_rad_s));
    }
    if (!frozen_position) e.position_time_us = now_us - 3000u;
    if (!frozen_attitude) e.attitude_time_us = now_us - 1000u;
    e.rate_time_us = now_us;
    tc_ground_alive(&c, 0u);
    join(name, tc_mission_state_text(c.mission.state), ", ", situation);
    count_begin();
    (void)tc_tick(&c, now_us, &e, &output);
    count_end("tc_tick", name);
}

static void ticks(float seconds) {
    for (float s = 0.0f; s < seconds; s += 1e-6f * (float)STEP_US) tick();
}

static bool reach(uint8_t state, float most_s) {
    for (float s = 0.0f; s < most_s && c.mission.state != state; s += 1e-6f * (float)STEP_US) tick();
    return c.mission.state == state;
}

static void order(tc_command command, float value) {
    count_begin();
    (void)tc_do(&c, command, value);
    count_end("tc_do", tc_command_text((uint8_t)command));
}

/* From rest at one corner to rest at the next along the degree-11 smooth step; all twelve coefficients in use. */
void worst_case_segment(uint16_t index, tc_segment* out) {
    static const float smooth[TC_MAX_COEFFICIENTS] = {0.5f, 1.3535156f,  0.0f, -2.2558594f, 0.0f, 2.7070312f,
                                                      0.0f, -1.9335938f, 0.0f, 0.7519531f,  0.0f, -0.12304688f};
    static const float corner[3][TC_AXES] = {
        {0.0f, 0.0f, 1.5f, 0.0f}, {3.0f, 1.0f, 2.0f, 1.5f}, {2.0f, 3.0f, 1.2f, 0.4f}};
    const float *from = corner[index % 3u], *to = corner[(index + 1u) % 3u];
    memset(out, 0, sizeof *out);
    out->duration_us = 2000000u;
    for (int axis = 0; axis < TC_AXES; axis++) {
        for (int i = 0; i < TC_MAX_COEFFICIENTS; i++) out->coefficient[axis][i] = smooth[i] * (to[axis] - from[axis]);
        out->coefficient[axis][0] += from[axis];
    }
}

uint32_t worst_case_plan(tc_trajectory* plan, uint16_t segments) {
    memset(plan, 0, sizeof *plan);
    plan->header.id = 7u;
    plan->header.segment_count = segments;
    plan->header.coefficient_count = TC_MAX_COEFFICIENTS;
    for (uint16_t i = 0; i < segments; i++) worst_case_segment(i, &plan->segment[i]);
    plan->header.crc32 = tc_trajectory_crc32(plan);
    return plan->header.crc32;
}

static void upload(uint16_t segments) {
    static tc_trajectory plan;
    (void)worst_case_plan(&plan, segments);
    count_begin();
    (void)tc_upload_begin(&c, &plan.header);
    count_end("tc_upload_begin", "");
    for (uint16_t i = 0; i < segments; i++) {
        count_begin();
        (void)tc_upload_segment(&c, i, &plan.segment[i]);
        count_end("tc_upload_segment", "");
    }
    const tc_origin origin = {{1}, {2}, "worst case"};
    count_begin();
    (void)tc_upload_origin(&c, &origin);
    count_end("tc_upload_origin", "");
    tc_trajectory_sample sample;
    memset(&sample, 0, sizeof sample);
    sample.value[2] = 1.5f; /* at the start */
    count_begin();
    (void)tc_upload_sample(&c, &sample);
    count_end("tc_upload_sample", "");
    tc_reason reason = TC_BUSY;
    while (reason == TC_BUSY) { /* a slice of the checks a call */
        count_begin();
        reason = tc_upload_finish(&c);
        count_end("tc_upload_finish", "");
    }
    count_begin();
    (void)tc_upload_activate(&c, plan.header.id, plan.header.crc32);
    count_end("tc_upload_activate", "");
}

static void configure(bool all_features) {
    tc_parameters p;
    count_begin();
    tc_init(&c);
    count_end("tc_init", "");
    count_begin();
    tc_parameters_default(&p);
    count_end("tc_parameters_default", "");
    if (all_features) {
        p.airflow_velocity = 2.0f;
        p.rotor_lag_s = 0.03f;
        p.battery_gain_1_v = 0.02f;
        p.ki_xy_1_s3 = p.ki_z_1_s3 = 1.0f;
        p.flapping_kg_m = 1e-6f;
        p.damping_n_m_s[2] = 1e-3f;
        p.attitude_mode = 1.0f;
    }
    count_begin();
    (void)tc_parameters_set(&c, &p);
    count_end("tc_parameters_set", "");
}

static void begin(bool all_features) {
    memset(&e, 0, sizeof e);
    e.valid = TC_VALID_ALL;
    e.q_world_body[0] = 1.0f;
    e.specific_force_body_m_s2[2] = 9.81f;
    e.battery_v = 16.0f;
    frozen_position = frozen_attitude = false;
    jump_m_s = spin_rad_s = tilt_rad_s = 0.0f;
    situation = all_features ? "all features" : "";
    configure(all_features);
    upload(6u);
    ticks(0.2f);
    order(TC_COMMAND_ARM, 0.0f);
    ticks(0.1f);
    order(TC_COMMAND_TAKE_OFF, 1.5f);
    (void)reach(TC_HOLD, 10.0f);
    ticks(1.2f);
}

static void fly_path(void) {
    order(TC_COMMAND_START, 0.0f);
    (void)reach(TC_TRAJECTORY, 10.0f);
    ticks(0.8f);
}

/* Every state without and with all features of the parameters. */
static void every_state(bool all_features) {
    begin(all_features);
    fly_path();
    ticks(2.0f);
    order(TC_COMMAND_PAUSE, 0.0f);
    (void)reach(TC_PAUSED, 10.0f);
    ticks(0.1f);
    order(TC_COMMAND_TIME_SCALE, 0.8f);
    order(TC_COMMAND_RESUME, 0.0f);
    ticks(1.0f);
    order(TC_COMMAND_HOLD, 0.0f);
    (void)reach(TC_HOLD, 10.0f);
    order(TC_COMMAND_LAND, 0.0f);
    ticks(2.0f);
    e.specific_force_body_m_s2[2] = 9.81f;
    for (int i = 0; i < 1200 && c.mission.state == TC_LANDING; i++) { /* stands on something */
        static const char* const stages[] = {"none", "descend", "unload", "idle"};
        situation = stages[c.landing.stage & 3u];
        const float z = e.position_world_m[2];
        tick();
        c.telemetry.setpoint.position_world_m[2] = z;
        c.telemetry.setpoint.velocity_world_m_s[2] = 0.0f;
    }
    situation = all_features ? "all features" : "";
    order(TC_COMMAND_DISARM, 0.0f);
    order(TC_COMMAND_KILL, 0.0f);
}

static void trouble(const char* name, float jump, float spin, float tilt, bool all_features) {
    begin(all_features);
    fly_path();
    situation = name;
    jump_m_s = jump;
    spin_rad_s = spin;
    tilt_rad_s = tilt;
    for (int i = 0; i < 700 && tc_mission_in_air(c.mission.state); i++) tick();
}

static void losses(void) {
    begin(true);
    fly_path();
    frozen_position = true;
    situation = "dead reckoning";
    (void)reach(TC_EMERGENCY, 5.0f);
    situation = "no position";
    ticks(1.0f);
    e.valid = TC_VALID_ATTITUDE | TC_VALID_RATE;
    situation = "blind";
    ticks(1.0f);
    begin(true);
    fly_path();
    frozen_attitude = true;
    situation = "on the gyro";
    ticks(1.0f);
    begin(true);
    fly_path();
    situation = "relocalized";
    for (int i = 0; i < 40; i++) {
        e.reset_counter++;
        e.reset_position_world_m[0] = i % 2 == 0 ? 0.1f : -0.1f;
        e.reset_yaw_rad = i % 2 == 0 ? 0.1f : -0.1f;
        tick();
    }
    begin(true);
    fly_path();
    order(TC_COMMAND_LAND, 0.0f);
    (void)reach(TC_LANDING, 10.0f);
    begin(true);
    fly_path();
    e.battery_v = 1.0f;
    order(TC_COMMAND_KILL, 0.0f);
    ticks(0.1f);
}

static void other_controllers(void) {
    static const float speeds[TC_ROTORS] = {900.0f, 900.0f, 900.0f, 900.0f};
    memset(&e, 0, sizeof e);
    e.valid = TC_VALID_ALL;
    e.q_world_body[0] = 1.0f;
    e.specific_force_body_m_s2[2] = 9.81f;
    situation = "";
    configure(true);
    frozen_position = frozen_attitude = false;
    jump_m_s = spin_rad_s = tilt_rad_s = 0.0f;
    ticks(0.1f);
    count_begin();
    (void)tc_shadow(&c);
    count_end("tc_shadow", "");
    count_begin();
    (void)tc_shadow_end(&c);
    count_end("tc_shadow_end", "");
    (void)tc_shadow(&c);
    ticks(1.5f);
    count_begin();
    (void)tc_engage(&c, speeds);
    count_end("tc_engage", "");
    situation = "engaged";
    ticks(0.3f);
    count_begin();
    (void)tc_release(&c);
    count_end("tc_release", "");
    situation = "";
    ticks(0.1f);
}

static void the_rest(void) {
    tc_parameters p = *tc_parameters_now(&c);
    float low, high, preset;
    count_begin();
    (void)tc_parameters_check(&p, NULL);
    count_end("tc_parameters_check", "");
    count_begin();
    (void)tc_parameters_crc32(&p);
    count_end("tc_parameters_crc32", "");
    count_begin();
    (void)tc_parameters_find("no such name");
    count_end("tc_parameters_find", "");
    count_begin();
    (void)tc_parameters_put(&p, (uint16_t)(tc_parameters_count() - 1u), 1.0f);
    count_end("tc_parameters_put", "");
    count_begin();
    (void)tc_parameters_get(&p, (uint16_t)(tc_parameters_count() - 1u));
    count_end("tc_parameters_get", "");
    count_begin();
    (void)tc_parameters_range((uint16_t)(tc_parameters_count() - 1u), &low, &high, &preset);
    count_end("tc_parameters_range", "");
    count_begin();
    tc_ground_alive(&c, 0u);
    count_end("tc_ground_alive", "");
    count_begin();
    (void)tc_arming_check(&c);
    count_end("tc_arming_check", "");
    configure(false);
    upload(TC_MAX_SEGMENTS);
}

int driver_run(uint32_t number, uint32_t* crc32, uint32_t* states) {
    (void)number;
    *crc32 = *states = 0u;
    systick[1] = 0xffffffu;
    systick[2] = 0u;
    systick[0] = 5u; /* enabled, processor clock */
    count_begin();
    overhead = count_since();
    every_state(false);
    every_state(true);
    trouble("saturation", 0.0f, 12.0f, 120.0f, true);
    trouble("strong yaw", 0.0f, 12.0f, 0.0f, true);
    trouble("estimate jump", 12.0f, 0.0f, 0.0f, true);
    trouble("jump and saturation", 12.0f, 12.0f, 120.0f, true);
    losses();
    other_controllers();
    the_rest();
    worst_case_link();
    print_rows();
    return 0;
}

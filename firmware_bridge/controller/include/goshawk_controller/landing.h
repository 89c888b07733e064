/* Coming down, and knowing that the ground is there.

   Height is never used: the floor may be anywhere. Touchdown is what the body shows, in stages:

     DESCEND  a downward velocity is commanded; the set-point leads the vehicle by at most 0.25 m. The vehicle seems to
   be on something when it has moved at less than half that speed, or the lead has been at its limit, for 0.12 s. UNLOAD
   the collective falls to a tenth of the weight within 0.5 s. A vehicle that still flies gains downward speed (0.35 m/s
   within 0.2 s and 3 cm), and its accelerometer falls with the thrust: back to DESCEND. What counts is the change since
   the stage began, so that a bias of the vertical velocity does not. IDLE     0.3 s of stillness, then the rotors stop.

   Whatever bounces or vibrates: where 2 s of descent bring it no lower by 0.1 m, one UNLOAD is judged by height alone,
   and ends with the rotors stopped unless the vehicle falls by 0.15 m. So does what stands: over
   a second it misses 0.3 g of the fall that the thrust asked for would be. A blind descent gives back the speed that
   each UNLOAD costs. Without vertical velocity (an emergency) only the accelerometer can tell: an impact, or every
   second, starts UNLOAD; without an accelerometer the gyro does, as a small roll torque to and fro turns no vehicle
   that stands on its feet. Each 1.5 s it is pressed down for that, by 0.12 of the hover thrust, and must be silent for
   two periods.
 */
#ifndef GOSHAWK_CONTROLLER_LANDING_H
#define GOSHAWK_CONTROLLER_LANDING_H

#include <stdbool.h>
#include <stdint.h>

typedef enum {
    TC_LANDING_NONE = 0, /* not coming down */
    TC_LANDING_DESCEND = 1,
    TC_LANDING_UNLOAD = 2,
    TC_LANDING_IDLE = 3
} tc_landing_stage;

/* In a descent without vertical velocity. */
typedef enum {
    TC_UNTOUCHED = 0,
    TC_TOUCHED = 1,  /* something has been hit */
    TC_FALLS_OFF = 2 /* ... and has since been found to be an edge: it falls */
} tc_landing_touch;

typedef struct {
    uint64_t began_us;    /* the descent */
    uint64_t stage_us;    /* the stage */
    uint64_t airborne_us; /* when there was last no sign of contact */
    uint64_t upright_us;  /* when it last was upright or moving */
    uint64_t touched_us;  /* when something was first hit, */
    uint64_t impact_us;   /* and last */
    uint64_t sunk_us;     /* when it last was on its way to the lowest height */
    uint64_t pressed_us;  /* when the test by torque last began or ceased to press it down */
    float z_m;            /* height of the set-point */
    float speed_m_s;      /* downwards, as commanded now */
    float thrust_n;       /* collective in UNLOAD and IDLE */
    float start_thrust_n; /* when UNLOAD began */
    float start_velocity_m_s;
    float start_m;    /* height */
    float gained_m_s; /* downwards since UNLOAD began, by the accelerometer */
    float lowest_m;   /* height that the descent has come down to */
    float force_m_s2; /* specific force along body z, low-passed; 0 while it is not given */
    /* What a test by roll torque shows: that torque as the rotors lag, the roll rate it makes, the slow part of the
       measured one; both rates against the test's sign, added up over a period. */
    float rolling_n_m, predicted_rad_s, slow_rad_s, expected_rad, found_rad;
    uint8_t stage;     /* tc_landing_stage */
    uint8_t impacts;   /* how often something has been hit since touched_us, */
    bool impact;       /* and whether just now */
    uint8_t touched;   /* tc_landing_touch */
    bool lead_limited; /* the set-point is held back to 0.25 m below the vehicle */
    bool sure;         /* it has not come down for so long that this UNLOAD is judged by height alone */
    bool pressing;     /* with less thrust, for the test by torque */
    bool silent;       /* that test has had no answer in the last period */
} tc_landing;

#endif

/* The monitor: whether the pose agrees with the IMU, and with itself.

   Velocity is carried by the accelerometer, position by the estimated velocity, and heading by the gyro; the first two
   for windows of 0.15 to 0.3 s, of which two overlap and take turns. The pose is not believed while a window shows

     |change of velocity - integral of specific force| > 0.8 m/s, more by four standard deviations under vibration,
     |change of position - integral of velocity|       > 0.25 m,
     position and velocity that repeat bit by bit for 0.2 s while the accelerometer shakes or, without one, it turns,
   or, with a position or without, a heading more than 0.35 rad from the last tick's and the gyro's turn,

   and for half a second after. Meanwhile position is dead reckoned from before the window, the vehicle brakes, and what
   follows is the ladder of a lost position. A heading that jumped, or a third alarm within ten seconds, is final. A
   position that drifts slowly from its velocity (0.4 m, leaky in 3 s, horizontal) is an event of its own: it lands.

   Blind: a velocity and a position that lie consistently by less than 2.7 m/s2; a drift below 0.13 m/s; a heading that
   turns slower than the pose rate times 0.35 rad, until the vehicle accelerates by it; without an accelerometer, all of
   the velocity's. */
#ifndef GOSHAWK_CONTROLLER_MONITOR_H
#define GOSHAWK_CONTROLLER_MONITOR_H

#include <stdbool.h>
#include <stdint.h>

/* What is usable of a pose; the rest comes of dead reckoning, and is not judged. */
typedef enum { TC_MONITORED_NONE, TC_MONITORED_LEVEL, TC_MONITORED_HEIGHT, TC_MONITORED_ALL } tc_monitored;

/* One window: what the pose should be now, starting from what it was when the window began. */
typedef struct {
    float velocity_m_s[3]; /* carried by the accelerometer */
    float position_m[3];   /* carried by the estimated velocity */
    float reckoned_m[3];   /* carried by the velocity above */
    float age_s;
    bool forced; /* specific force was given all along */
} tc_monitor_window;

typedef struct {
    tc_monitor_window window[2];
    float shake_m2_s4;  /* variance of the accelerometer's noise, all axes */
    float last_pose[6]; /* position and velocity as given */
    float before_m[2];  /* horizontal position of the last tick */
    float last_step_s;
    float drift_m[2];    /* of position from its velocity, leaky */
    float turn[4];       /* brings the estimated attitude back to the heading before it jumped, */
    uint64_t changed_us; /* when the pose last changed */
    uint64_t alarm_us;   /* when it last was wrong */
    uint64_t first_us;   /* the first alarm of the last ten seconds */
    uint8_t alarms;      /* since then */
    uint8_t reason;      /* tc_reason of the last alarm; TC_OK: none */
    bool final;          /* not believed again in this flight */
    bool running;        /* the windows have begun */
    bool turned;         /* the heading has jumped */
    bool doubted;        /* in the last tick */
    bool drifts;         /* slowly */
    uint8_t part;        /* tc_monitored: in the last tick */
} tc_monitor;

#endif

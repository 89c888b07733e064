/* Goshawk's trajectory controller: the umbrella header, and the manual's table of contents.

     reason.h       why something was refused or changed
     trajectory.h   staged and active slot, checks at commit, O(1) evaluation
     shaping.h      the path clock (time scale, pause, abort) and point-to-point moves
     flatness.h     thrust vector and yaw to attitude and rates
     position.h     eq. (9)
     attitude.h     tilt-prioritised attitude loop, Lee et al. as an option
     mixer.h        wrench to rotor speeds, exact inverse of eqs. (1)-(3)
     mission.h      the state machine
     parameters.h   every number that can be set
     controller.h   the whole: tc_init, tc_tick, and what the ground may ask for
     version.h      the version of this library

   Rules that hold everywhere: C11, float32, SI, world z up, body x forward y left z up, quaternions w x y z, time in
   integer microseconds. No heap, no globals, no recursion, no libm beyond sqrtf; state lives in structs you own.
   "Eq. (n)" is Rigter et al. 2019. */
#ifndef GOSHAWK_CONTROLLER_GOSHAWK_CONTROLLER_H
#define GOSHAWK_CONTROLLER_GOSHAWK_CONTROLLER_H

#include "goshawk_controller/controller.h"
#include "goshawk_controller/version.h"

#endif

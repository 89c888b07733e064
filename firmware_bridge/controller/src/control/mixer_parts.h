/* What the two files of the mixer share. Not for users. */
#ifndef MIXER_PARTS_H
#define MIXER_PARTS_H

/* Where the move along the free direction changes a rotor's load by more than this share (of it and a little of what
   hovering takes), its operating point is found once more: strong yaw together with fast air, or with a rotor that is
   asked for next to nothing. What is left is less than 1e-5 of full speed for every feasible demand, see
   tests/firmware_bridge/test_controller_numbers.py. */
static const float TC_MIXER_FAR = 0.05f;

#endif

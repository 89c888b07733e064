#pragma once
#define ARM_LENGTH 0.046f          /* m */
#define CF_MASS 0.029f             /* kg */
#define THRUST_MAX 0.12f           /* N per motor */
#define THRUST2TORQUE 0.006992895f /* m */

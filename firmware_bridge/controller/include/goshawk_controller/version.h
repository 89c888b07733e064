/* The version of this library. CMake's package version is read from these three lines, and the tests hold the
   Python package's version to them, so this is the place to change it.

       #if TC_VERSION >= TC_VERSION_NUMBER(0, 2, 0)

   A change of the major number (of the minor one while it is 0) may change structs and functions. */
#ifndef GOSHAWK_CONTROLLER_VERSION_H
#define GOSHAWK_CONTROLLER_VERSION_H

#define TC_VERSION_MAJOR 0
#define TC_VERSION_MINOR 1
#define TC_VERSION_PATCH 0

#define TC_VERSION_NUMBER(major, minor, patch) ((major) * 1000000 + (minor) * 1000 + (patch))
#define TC_VERSION TC_VERSION_NUMBER(TC_VERSION_MAJOR, TC_VERSION_MINOR, TC_VERSION_PATCH)

#endif

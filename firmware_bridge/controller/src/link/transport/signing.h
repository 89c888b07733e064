/* What signing and frames share. Internal. */
#ifndef LINK_SIGNING_H
#define LINK_SIGNING_H

#include "goshawk_controller/link_codec.h"

enum { LINK_SIGNATURE = 13 }; /* bytes: link id, time stamp of six, six of the hash */

/* Appends the signature of the `n` bytes of a frame; returns its length. */
size_t link_sign(tc_signing* signing, uint8_t* frame, size_t n, uint8_t link_id);

#endif

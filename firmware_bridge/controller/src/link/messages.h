/* The tables of messages. Internal. */
#ifndef LINK_MESSAGES_H
#define LINK_MESSAGES_H

#include "services/services.h"

/* Carries a frame out that was let in. */
void link_dispatch(tc_link* link, const tc_frame* frame);
/* Encodes the most urgent pending message; false when nothing is pending. */
bool link_encode_next(tc_link* link, uint8_t* payload, uint8_t* row);

#endif

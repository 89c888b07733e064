/* The tables of messages. Internal. */
#ifndef LINK_MESSAGES_H
#define LINK_MESSAGES_H

#include "services/services.h"

/* Carries a frame out that was let in. */
void link_dispatch(tc_link* link, const tc_frame* frame);
/* Encodes the pending message whose turn it is, an answer before all others; LINK_OUT_COUNT when there is none. */
link_out link_next_message(tc_link* link, uint8_t* payload, uint8_t* row);

#endif

#pragma once
#define PARAM_UINT8 8
/* A pointer by which the test can set it. */
#define PARAM_GROUP_START(group) extern unsigned char* const interface_param_engage;
#define PARAM_ADD(type, name, address) unsigned char* const interface_param_##name = (address);
#define PARAM_GROUP_STOP(group) extern unsigned char* const interface_param_engage;

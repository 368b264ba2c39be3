/* The header as a library, so that a Python program can ask the very code that a device loop asks. */
#define TJ_IMPLEMENTATION
#include "tissuejax_force.h"
size_t tj_state_size(void);
size_t tj_state_size(void) { return sizeof(tj_state); }

/* The header as a library, so that a Python program can ask the very code that a device loop asks. */
#define TJ_IMPLEMENTATION
#include "tissuejax_force.h"
#include <time.h>
size_t tj_state_size(void);
size_t tj_state_size(void) { return sizeof(tj_state); }

/* Seconds for one force, the mean of `count` along a path that presses and circles; nothing else in between. */
double tj_seconds(const tj_model *model, long count);
double tj_seconds(const tj_model *model, long count) {
    double box[7], p[3], f[3], sum = 0;
    tj_state state;
    clock_t begun;
    long k;
    tj_rest(model, &state);
    tj_box(model, box);
    begun = clock();
    for (k = 0; k < count; k++) {
        double turn = 6.283185307179586 * (double)k / 1000;
        p[0] = (box[0] + box[2]) / 2 + 0.4 * (box[2] - box[0]) * sin(turn);
        p[1] = (box[1] + box[3]) / 2 + 0.4 * (box[3] - box[1]) * cos(turn);
        p[2] = box[6] - box[4] * (0.5 + 0.4 * sin(3 * turn));
        tj_force(model, &state, p, 1e-3, f);
        sum += f[2];
    }
    return sum == -1 ? 0 : (double)(clock() - begun) / CLOCKS_PER_SEC / (double)count; /* the sum keeps the loop */
}

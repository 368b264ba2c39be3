/* Tissue in an OpenHaptics HDAPI scheduler callback. HDAPI tells millimetres with y up; forces are newtons. A stand-in for
 * the scheduler and the device is below, so that this file compiles and runs alone. */
#define TJ_STATIC
#include "tissuejax_force.h"

/* ---- stand-in for hd.h */
typedef double HDdouble;
typedef int HDCallbackCode;
#define HDCALLBACK
enum { HD_CALLBACK_CONTINUE = 1, HD_CURRENT_POSITION, HD_CURRENT_FORCE };
static int tick_ = 0;
static double held_[3], top_[3];
static void hdGetDoublev(int what, HDdouble v[3]) { /* y up, mm: pressed 3 mm in, over one second */
    double down = 4.0 * (tick_ < 1000 ? tick_ / 1000.0 : 1) - 1;
    (void)what;
    v[0] = 1e3 * top_[0]; v[1] = 1e3 * top_[2] - down; v[2] = -1e3 * top_[1];
}
static void hdSetDoublev(int what, const HDdouble v[3]) { (void)what; held_[0] = v[0]; held_[1] = v[1]; held_[2] = v[2]; }

typedef struct { tj_model *model; tj_state state; tj_guard guard; } tissue;

static HDCallbackCode HDCALLBACK touch(void *data) {
    tissue *t = (tissue *)data;
    HDdouble p[3], f[3];
    double at[3], force[3];
    hdGetDoublev(HD_CURRENT_POSITION, p);
    at[0] = 1e-3 * p[0]; at[1] = -1e-3 * p[2]; at[2] = 1e-3 * p[1];
    tj_force(t->model, &t->state, at, 1e-3, force);
    tj_safe(&t->guard, at, 0.0, 1e-3, force);
    f[0] = force[0]; f[1] = force[2]; f[2] = -force[1];
    hdSetDoublev(HD_CURRENT_FORCE, f);
    return HD_CALLBACK_CONTINUE;
}

int main(int argc, char **argv) {
    tissue t;
    double box[7], p[3];
    t.model = argc > 1 ? tj_open(argv[1]) : NULL;
    if (!t.model) { fprintf(stderr, "%s\n", tj_fault()); return 2; }
    tj_box(t.model, box);
    top_[0] = (box[0] + box[2]) / 2; top_[1] = (box[1] + box[3]) / 2; top_[2] = box[6];
    tj_rest(t.model, &t.state);
    tj_guard_start(&t.guard, 3.0, 300.0, 0.2);
    for (tick_ = 0; tick_ < 1500; tick_++) { /* hdScheduleAsynchronous(touch, &t, HD_MAX_SCHEDULER_PRIORITY) */
        touch(&t);
        hdGetDoublev(HD_CURRENT_POSITION, p);
        printf("%.9g %.9g %.9g %.9g %.9g %.9g\n", 1e-3 * p[0], -1e-3 * p[2], 1e-3 * p[1], held_[0], -held_[2], held_[1]);
    }
    tj_close(t.model);
    return 0;
}

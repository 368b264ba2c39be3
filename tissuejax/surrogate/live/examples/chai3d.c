/* Tissue in a CHAI3D haptics thread. CHAI3D's loop reads the device, asks for a force and sends it; the three calls are
 * marked. Here a stand-in for the device presses and lifts by itself, so that this file compiles and runs alone. */
#define TJ_STATIC
#include "tissuejax_force.h"

/* ---- stand-in for cGenericHapticDevicePtr: getPosition, setForce */
static double tick_ = 0, start_[3];
static void device_position(double p[3]) {
    p[0] = start_[0]; p[1] = start_[1]; p[2] = start_[2] + 1e-3 - 3e-3 * (1 - cos(3.14159 * tick_ / 1000)) / 2 * 2;
    tick_ += 1;
}
static void device_force(const double p[3], const double f[3]) {
    printf("%.9g %.9g %.9g %.9g %.9g %.9g\n", p[0], p[1], p[2], f[0], f[1], f[2]);
}

int main(int argc, char **argv) {
    tj_model *model = argc > 1 ? tj_open(argv[1]) : NULL;
    tj_state state; tj_guard guard;
    double p[3], f[3], box[7], dt = 1e-3;
    int k;
    if (!model) { fprintf(stderr, "%s\n", tj_fault()); return 2; }
    tj_box(model, box);
    start_[0] = (box[0] + box[2]) / 2; start_[1] = (box[1] + box[3]) / 2; start_[2] = box[6];
    tj_rest(model, &state);
    tj_guard_start(&guard, 3.0, 300.0, 0.2);
    for (k = 0; k < 1500; k++) {       /* while (simulationRunning) { */
        device_position(p);            /*   hapticDevice->getPosition(position);  (metres, z up) */
        tj_force(model, &state, p, dt, f);
        tj_safe(&guard, p, 0.0, dt, f);
        device_force(p, f);            /*   hapticDevice->setForce(cVector3d(f[0], f[1], f[2])); */
    }
    tj_close(model);
    return 0;
}

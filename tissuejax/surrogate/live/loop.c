/* The haptic loop: a force every period, at absolute times, its lateness measured.
 *
 * loop MODEL.tjf RATE SECONDS PORT MOST SLEW SAMPLES.bin
 *   PORT 0: a hand that presses and circles by itself (for measuring); else UDP on 127.0.0.1:PORT, packets in
 *   {u32 sequence, u32 0, f64 time, f64 x, y, z}, packets out {u32 sequence, u32 flags, f64 x, y, z force}, little-endian.
 *   SAMPLES.bin: for every period, f32 lateness and f32 time of the evaluation, s.
 * A period that is missed is kept as late as it was: due times stay start + k / RATE.
 */
#define _GNU_SOURCE
#define TJ_STATIC
#include "tissuejax_force.h"
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static volatile sig_atomic_t stop_ = 0;
static void ended(int s) { (void)s; stop_ = 1; }
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }
typedef struct { uint32_t sequence, zero; double time, at[3]; } in_packet;
typedef struct { uint32_t sequence, flags; double force[3]; } out_packet;

int main(int argc, char **argv) {
    if (argc != 8) { fprintf(stderr, "loop MODEL RATE SECONDS PORT MOST SLEW SAMPLES\n"); return 2; }
    tj_model *model = tj_open(argv[1]);
    if (!model) { fprintf(stderr, "%s: %s\n", argv[1], tj_fault()); return 2; }
    double rate = atof(argv[2]), seconds = atof(argv[3]), box[7], dt = 1 / rate;
    int port = atoi(argv[4]), sock = -1;
    long count = (long)(rate * seconds), k, used = 0, answered = 0, missed = 0;
    float *kept = (float *)calloc((size_t)count * 2 + 2, sizeof(float));
    if (!kept) return 2;
    memset(kept, 1, ((size_t)count * 2 + 2) * sizeof(float)); /* touched now, not in the loop */
    if (port) {
        struct sockaddr_in a;
        memset(&a, 0, sizeof a);
        a.sin_family = AF_INET; a.sin_port = htons((uint16_t)port); a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        sock = socket(AF_INET, SOCK_DGRAM, 0);
        if (sock < 0 || bind(sock, (struct sockaddr *)&a, sizeof a)) { fprintf(stderr, "port %d is taken\n", port); return 4; }
        fcntl(sock, F_SETFL, O_NONBLOCK);
    }
    signal(SIGINT, ended); signal(SIGTERM, ended);
    struct sched_param priority = {.sched_priority = 80};
    int real = sched_setscheduler(0, SCHED_FIFO, &priority) == 0, locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    tj_state state; tj_guard guard;
    tj_rest(model, &state); tj_box(model, box); tj_guard_start(&guard, atof(argv[5]), atof(argv[6]), 0.5);
    double p[3] = {(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, box[6] + 1e-3}, f[3], sum = 0, heard = -1;
    in_packet in; out_packet out = {0, 0, {0, 0, 0}};
    struct sockaddr_in from; socklen_t size = sizeof from; int known = 0;
    double begin = now() + 0.01;
    printf("ready %d %d\n", real, locked); fflush(stdout);
    for (k = 0; k < count && !stop_; k++) {
        double due = begin + (double)k * dt, at, age = 0;
        struct timespec t = {(time_t)due, (long)((due - floor(due)) * 1e9)};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR && !stop_) {}
        at = now();
        if (port) {
            in_packet got; struct sockaddr_in who; socklen_t n = sizeof who;
            int fresh = 0; ssize_t length;
            while ((length = recvfrom(sock, &got, sizeof got, 0, (struct sockaddr *)&who, &n)) >= 0) {
                if (length != (ssize_t)sizeof got) { missed++; continue; }
                in = got; from = who; size = n; fresh = known = 1; heard = at;
            }
            if (fresh) { p[0] = in.at[0]; p[1] = in.at[1]; p[2] = in.at[2]; }
            age = heard < 0 ? 1e9 : at - heard;
        } else {
            double s = (double)k * dt, w = 6.283185307179586;
            p[0] = (box[0] + box[2]) / 2 + 0.4 * (box[2] - box[0]) * sin(w * 0.31 * s);
            p[1] = (box[1] + box[3]) / 2 + 0.4 * (box[3] - box[1]) * sin(w * 0.43 * s);
            p[2] = box[6] - box[4] * (0.45 - 0.5 * cos(w * 0.5 * s));
        }
        tj_force(model, &state, p, dt, f);
        tj_safe(&guard, p, age, dt, f);
        kept[2 * k] = (float)(at - due);
        kept[2 * k + 1] = (float)(now() - at);
        sum += f[2];
        if (port && known) {
            out.sequence = in.sequence; out.flags = (uint32_t)guard.limited;
            memcpy(out.force, f, sizeof f);
            if (sendto(sock, &out, sizeof out, 0, (struct sockaddr *)&from, size) == (ssize_t)sizeof out) answered++;
        }
        used = k + 1;
    }
    double took = now() - begin;
    FILE *file = fopen(argv[7], "wb");
    if (!file || fwrite(kept, sizeof(float), (size_t)used * 2, file) != (size_t)used * 2) return 3;
    fclose(file);
    printf("done %ld %.6f %ld %ld %.9f\n", used, took, answered, missed, sum / (double)(used ? used : 1));
    tj_close(model);
    return 0;
}

/* tissuejax_force.h: the force of tissue on a ball, from a file made by `tissuejax play MODEL --export FILE.tjf`.
 *
 * C99, no dependency but the C library, one header. tj_open allocates once; tj_force, tj_guard allocate nothing, take a
 * few microseconds, and may be called from a haptic thread (CHAI3D, OpenHaptics HDAPI, or a loop of your own):
 *
 *     tj_model *model = tj_open("organ.tjf");            NULL: tj_fault() says why
 *     tj_state state; tj_rest(model, &state);
 *     tj_guard guard; tj_guard_start(&guard, 3.0, 300.0, 0.5);      3 N, 300 N/s, half a second of ramp-in
 *     each tick:  tj_force(model, &state, position, dt, force);     metres, seconds, newtons
 *                 tj_safe(&guard, position, age, dt, force);        limits; zero for stale or bad positions
 *     tj_close(model);
 *
 * Frame: z up, the ball presses down along -z. `force` is that of the tissue on the ball.
 * Define TJ_IMPLEMENTATION in one source file before including it, or TJ_STATIC for static functions.
 */
#ifndef TISSUEJAX_FORCE_H
#define TISSUEJAX_FORCE_H
#include <stddef.h>

#define TJ_MODES 64 /* stress modes at most */
#define TJ_TERMS 8  /* Prony terms at most */

#if defined(TJ_STATIC)
#define TJ_API static
#define TJ_IMPLEMENTATION
#elif !defined(TJ_API)
#define TJ_API
#endif

typedef struct tj_model tj_model;

/* What the tissue remembers; a plain value that may be copied. */
typedef struct {
    double gone[TJ_TERMS][TJ_MODES], now[TJ_MODES]; /* stress modes relaxed, and as they are */
    double stretch[2], stiffness, at[2], deepest;   /* friction and adhesion */
    double share;                                   /* of the force that is left: falls beyond the sides of the box */
    int started;
    double depth;                                   /* of the last tick, below first contact, m */
} tj_state;

/* Limits on what a device is told. */
typedef struct {
    double most, slew, ramp; /* N, N/s, s until the full force is allowed */
    double stale;            /* s: a position older than this gives zero force */
    double last[3], since;
    int limited;             /* what acted at the last tick: 1 force, 2 slew, 4 ramp, 8 stale or not finite */
} tj_guard;

TJ_API tj_model *tj_open(const char *path);
TJ_API void tj_close(tj_model *model);
TJ_API const char *tj_fault(void);
TJ_API void tj_rest(const tj_model *model, tj_state *state);
TJ_API void tj_force(const tj_model *model, tj_state *state, const double position[3], double dt, double force[3]);
TJ_API void tj_guard_start(tj_guard *guard, double most, double slew, double ramp);
TJ_API void tj_safe(tj_guard *guard, const double position[3], double age, double dt, double force[3]);
/* Box and ball, m: low x, low y, high x, high y, greatest depth, radius, height of the centre at first contact in the
 * middle. */
TJ_API void tj_box(const tj_model *model, double box[7]);

#ifdef TJ_IMPLEMENTATION
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Sums side by side, as many as the processor adds at once; loops do the same where vectors have no name. */
#if defined(__AVX512F__)
#define TJ__WIDE 8
#else
#define TJ__WIDE 4
#endif
#if defined(__GNUC__)
typedef double tj__sums __attribute__((vector_size(8 * TJ__WIDE)));
#define TJ__ADD(to, by, from) ((to) += (by) * (from))
#define TJ__ADDS(to, by, from) ((to) += (by) * (from))
#define TJ__PART(v, a) ((v)[a])
#else
typedef struct { double part[TJ__WIDE]; } tj__sums;
#define TJ__ADD(to, by, from) \
    do { int a_; for (a_ = 0; a_ < TJ__WIDE; a_++) (to).part[a_] += (by) * (from).part[a_]; } while (0)
#define TJ__ADDS(to, by, from) \
    do { int a_; for (a_ = 0; a_ < TJ__WIDE; a_++) (to).part[a_] += (by).part[a_] * (from).part[a_]; } while (0)
#define TJ__PART(v, a) ((v).part[a])
#endif
#define TJ__NONE {0}

/* `m` values at a place: one, in `c`; or many, in `wide`, `row` times TJ__WIDE of them, filled with zeros. */
typedef struct { double origin[3], per[3]; int n[3], m, row; double *c; tj__sums *wide; void *own; } tj__table;
struct tj_model {
    double low[2], high[2], depth, radius, factor, friction, give, strength, reach, slip[3];
    int terms;
    double g[TJ_TERMS], tau[TJ_TERMS];
    tj__table touch, law, stress, strain;
};

static const char *tj__said = "";
TJ_API const char *tj_fault(void) { return tj__said; }

static int tj__read(FILE *f, void *to, size_t size) { return fread(to, 1, size, f) == size; }
static int tj__table_in(FILE *f, tj__table *t, int axes, int wide) {
    int32_t n[4];
    size_t i, count = 1;
    int j;
    if (!tj__read(f, n, sizeof n)) return 0;
    for (i = 0; i < 4; i++) if (n[i] < 1 || n[i] > 100000) return 0;
    for (i = 0; i < 3; i++) { t->n[i] = n[i]; count *= (size_t)n[i]; }
    for (i = 0; i < (size_t)axes; i++) if (n[i] < 4) return 0;
    t->m = n[3];
    if (t->m > TJ_MODES || count > (size_t)1 << 26) return 0;
    if (!wide && t->m != 1) return 0;
    t->row = (t->m + TJ__WIDE - 1) / TJ__WIDE;
    if (!tj__read(f, t->origin, sizeof t->origin) || !tj__read(f, t->per, sizeof t->per)) return 0;
    t->own = calloc(count + 8, wide ? (size_t)t->row * sizeof(tj__sums) : sizeof(double));
    if (!t->own) return 0;
    t->c = (double *)(((uintptr_t)t->own + 63) & ~(uintptr_t)63);
    t->wide = (tj__sums *)t->c;
    for (i = 0; i < count; i++) {
        double *c = t->c + (wide ? i * (size_t)(t->row * TJ__WIDE) : i);
        if (!tj__read(f, c, (size_t)t->m * sizeof(double))) return 0;
        for (j = 0; j < t->m; j++) if (!isfinite(c[j])) return 0;
    }
    return 1;
}

static int tj__alike(const tj__table *a, const tj__table *b) {
    return a->m == b->m && !memcmp(a->n, b->n, sizeof a->n) && !memcmp(a->origin, b->origin, sizeof a->origin)
        && !memcmp(a->per, b->per, sizeof a->per);
}

TJ_API tj_model *tj_open(const char *path) {
    char magic[8];
    int32_t head[2];
    double v[14];
    int fine = 0;
    FILE *f = fopen(path, "rb");
    tj_model *model = (tj_model *)calloc(1, sizeof *model);
    tj__said = "no such file";
    if (f && model) {
        tj__said = "not a tissuejax force file, or of another version";
        if (tj__read(f, magic, 8) && !memcmp(magic, "TJFORCE2", 8) && tj__read(f, head, sizeof head) && head[0] >= 0
            && head[0] <= TJ_TERMS) {
            tj__said = "cut off or damaged";
            model->terms = head[0];
            fine = tj__read(f, v, sizeof v) && tj__read(f, model->g, sizeof model->g)
                && tj__read(f, model->tau, sizeof model->tau) && tj__table_in(f, &model->touch, 2, 0)
                && tj__table_in(f, &model->law, 3, 0);
            if (fine && model->terms) fine = tj__table_in(f, &model->stress, 3, 1)
                && tj__table_in(f, &model->strain, 3, 1) && tj__alike(&model->stress, &model->strain);
        }
    }
    if (f) fclose(f);
    if (!fine) { tj_close(model); return NULL; }
    model->low[0] = v[0]; model->low[1] = v[1]; model->high[0] = v[2]; model->high[1] = v[3];
    model->depth = v[4]; model->radius = v[5]; model->factor = v[6];
    model->friction = v[7]; model->give = v[8]; model->strength = v[9]; model->reach = v[10];
    model->slip[0] = v[11]; model->slip[1] = v[12]; model->slip[2] = v[13];
    tj__said = "";
    return model;
}

TJ_API void tj_close(tj_model *model) {
    if (!model) return;
    free(model->touch.own); free(model->law.own); free(model->stress.own); free(model->strain.own); free(model);
}

TJ_API void tj_rest(const tj_model *model, tj_state *state) {
    (void)model;
    memset(state, 0, sizeof *state);
    state->deepest = -1;
    state->depth = -1;
    state->share = 1;
}

static void tj__basis(double u, double per, double b[4], double d[4]) {
    double v = 1 - u;
    b[0] = v * v * v / 6; b[1] = ((3 * u - 6) * u * u + 4) / 6;
    b[2] = ((3 * v - 6) * v * v + 4) / 6; b[3] = u * u * u / 6;
    d[0] = -v * v / 2 * per; d[1] = (3 * u - 4) * u / 2 * per;
    d[2] = -(3 * v - 4) * v / 2 * per; d[3] = u * u / 2 * per;
}

typedef struct { double b[3][4], d[3][4]; size_t first, x, y; } tj__spot;

/* Where a place lies in a table: basis, slopes, number of the first node and the strides from there. */
static void tj__find(const tj__table *t, int axes, const double at[3], tj__spot *q) {
    int first[3] = {0, 0, 0}, a;
    for (a = 0; a < axes; a++) {
        double x = (at[a] - t->origin[a]) * t->per[a];
        int k = (int)floor(x);
        first[a] = k = k < 0 ? 0 : k > t->n[a] - 4 ? t->n[a] - 4 : k;
        tj__basis(x - k, t->per[a], q->b[a], q->d[a]);
    }
    q->y = (size_t)t->n[2];
    q->x = q->y * (size_t)t->n[1];
    q->first = q->x * (size_t)first[0] + q->y * (size_t)first[1] + (size_t)first[2];
}

/* Value, d/dx, d/dy, d/ds, d2/dxds, d2/dyds of a table of one value. */
static void tj__one(const tj__table *t, int axes, const double at[3], double r[6]) {
    tj__spot q;
    int i, j, l;
    tj__find(t, axes, at, &q);
    for (i = 0; i < 6; i++) r[i] = 0;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++) {
            double p = 0, s = 0, v = q.b[0][i] * q.b[1][j], vx = q.d[0][i] * q.b[1][j], vy = q.b[0][i] * q.d[1][j];
            const double *c = t->c + q.first + q.x * (size_t)i + q.y * (size_t)j;
            if (axes == 2) p = c[0];
            else for (l = 0; l < 4; l++) { p += q.b[2][l] * c[l]; s += q.d[2][l] * c[l]; }
            r[0] += v * p; r[1] += vx * p; r[2] += vy * p; r[3] += v * s; r[4] += vx * s; r[5] += vy * s;
        }
}

/* The values alone of a table of many over x, y, s. */
static void tj__many(const tj__table *t, const tj__spot *q, tj__sums *out) {
    int i, j, l, m, M = t->row;
    double v[16][4];
    const tj__sums *row[16];
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++) {
            row[4 * i + j] = t->wide + (q->first + q->x * (size_t)i + q->y * (size_t)j) * (size_t)M;
            for (l = 0; l < 4; l++) v[4 * i + j][l] = q->b[0][i] * q->b[1][j] * q->b[2][l];
        }
    for (m = 0; m < M; m++) {
        tj__sums w0 = TJ__NONE, w1 = TJ__NONE, w2 = TJ__NONE, w3 = TJ__NONE; /* four that don't wait for each other */
        for (i = 0; i < 16; i++) {
            const tj__sums *c = row[i] + m;
            TJ__ADD(w0, v[i][0], c[0]); TJ__ADD(w1, v[i][1], c[M]);
            TJ__ADD(w2, v[i][2], c[2 * M]); TJ__ADD(w3, v[i][3], c[3 * M]);
        }
        TJ__ADD(w0, 1, w1); TJ__ADD(w2, 1, w3); TJ__ADD(w0, 1, w2);
        out[m] = w0;
    }
}

/* Value and slopes by x, y, s of a table over x, y, s whose M values are taken together with these weights first. */
static void tj__loaded(const tj__table *t, const tj__spot *q, const tj__sums *load, double out[4]) {
    tj__sums r0 = TJ__NONE, r1 = TJ__NONE, r2 = TJ__NONE, r3 = TJ__NONE;
    const double *b = q->b[2], *d = q->d[2];
    int i, j, a, m, M = t->row;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++) {
            tj__sums w0 = TJ__NONE, w1 = TJ__NONE, w2 = TJ__NONE, w3 = TJ__NONE, p = TJ__NONE, s = TJ__NONE;
            const tj__sums *c = t->wide + (q->first + q->x * (size_t)i + q->y * (size_t)j) * (size_t)M;
            for (m = 0; m < M; m++, c++) {
                TJ__ADDS(w0, load[m], c[0]); TJ__ADDS(w1, load[m], c[M]);
                TJ__ADDS(w2, load[m], c[2 * M]); TJ__ADDS(w3, load[m], c[3 * M]);
            }
            TJ__ADD(p, b[0], w0); TJ__ADD(p, b[1], w1); TJ__ADD(p, b[2], w2); TJ__ADD(p, b[3], w3);
            TJ__ADD(s, d[0], w0); TJ__ADD(s, d[1], w1); TJ__ADD(s, d[2], w2); TJ__ADD(s, d[3], w3);
            TJ__ADD(r0, q->b[0][i] * q->b[1][j], p); TJ__ADD(r1, q->d[0][i] * q->b[1][j], p);
            TJ__ADD(r2, q->b[0][i] * q->d[1][j], p); TJ__ADD(r3, q->b[0][i] * q->b[1][j], s);
        }
    for (out[0] = out[1] = out[2] = out[3] = 0, a = 0; a < TJ__WIDE; a++) {
        out[0] += TJ__PART(r0, a); out[1] += TJ__PART(r1, a); out[2] += TJ__PART(r2, a); out[3] += TJ__PART(r3, a);
    }
}

static double tj__clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }
static double tj__pull(double gap, double reach) {
    double g = tj__clip(gap / reach, 0, 5);
    return reach * (2.718281828459045 - (1 + g) * exp(1 - g));
}

static void tj__rub(const tj_model *m, tj_state *s, const double p[3], double depth, double stiff, double f[3]) {
    double normal = f[2] > 0 ? f[2] : 0, extra[3] = {0, 0, 0};
    if (m->strength > 0) {
        double near = depth < 0 ? -depth : 0, in = depth > 0 ? depth : 0;
        if (depth > 0 && depth > s->deepest) s->deepest = depth;
        if (s->deepest >= 0) {
            double bonds = tj__pull(near + (s->deepest - in) / 2, m->reach) - tj__pull(near, m->reach);
            extra[2] = -6.283185307179586 * m->radius * m->strength * bonds;
        }
        if (near > 5 * m->reach || s->share <= 0) s->deepest = -1;
    }
    if (m->friction > 0) {
        double k = 2.0 / 3 * stiff, keep, x, y, length, slid, q = tj__clip(depth / m->depth, 0, 1);
        double limit = m->friction * normal * (1 + q * (m->slip[0] + q * (m->slip[1] + q * m->slip[2])));
        k = k / (1 + k * m->give / (3.141592653589793 * m->radius * (depth > 1e-9 ? depth : 1e-9)));
        keep = k > s->stiffness ? s->stiffness / k : 1;
        x = s->stretch[0] * keep + p[0] - s->at[0];
        y = s->stretch[1] * keep + p[1] - s->at[1];
        length = k * sqrt(x * x + y * y + 1e-30);
        slid = limit / (length > 1e-30 ? length : 1e-30);
        if (slid > 1) slid = 1;
        if (!(depth > 0 && k > 0)) slid = 0;
        s->stretch[0] = slid * x; s->stretch[1] = slid * y; s->stiffness = k;
        extra[0] = -k * s->stretch[0]; extra[1] = -k * s->stretch[1];
    }
    s->at[0] = p[0]; s->at[1] = p[1];
    f[0] += extra[0]; f[1] += extra[1]; f[2] += extra[2];
}

TJ_API void tj_force(const tj_model *m, tj_state *state, const double p[3], double dt, double f[3]) {
    double at[3], t[6], z[6], beyond[2], r, fade = 1, depth, inside, below, s, stiff = 0, D = m->depth;
    double free_[2];
    int a, k, i;
    f[0] = f[1] = f[2] = 0;
    if (!(isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]) && isfinite(dt)) || dt < 0) return;
    if (!state->started) { state->started = 1; state->at[0] = p[0]; state->at[1] = p[1]; }
    for (a = 0; a < 2; a++) {
        at[a] = tj__clip(p[a], m->low[a], m->high[a]);
        beyond[a] = p[a] - at[a];
        free_[a] = beyond[a] == 0 ? 1 : 0;
    }
    tj__one(&m->touch, 2, at, z);
    state->depth = depth = z[0] - p[2];
    inside = tj__clip(depth, 0, D); below = depth > D ? depth - D : 0;
    at[2] = s = sqrt(inside / D);
    r = sqrt(beyond[0] * beyond[0] + beyond[1] * beyond[1]) / 1e-3;
    if (r >= 1) fade = 0;
    else if (r > 0) fade = 1 - r * r * r * (10 - 15 * r + 6 * r * r);
    /* what faded comes back only once the ball was lifted: no push outwards, and no work for nothing */
    state->share = depth <= 0 ? 1 : fade < state->share ? fade : state->share;
    if (state->share < fade) fade = state->share;
    if (depth > 0) {
        double d15 = D * sqrt(D), s5 = s * s * s * s * s, up;
        tj__one(&m->law, 3, at, t);
        up = m->factor * d15 * s * s * s * (5 * t[0] + s * t[3]) / 2;
        for (a = 0; a < 2; a++) {
            double aside = m->factor * (d15 * D * s5 * t[1 + a] + below * d15 * (5 * t[1 + a] + t[4 + a]) / 2);
            f[a] = -free_[a] * (aside + up * z[1 + a]);
        }
        f[2] = up;
        stiff = 1.5 * up / (inside > 1e-9 ? inside : 1e-9);
    }
    if (m->terms) {
        union { double one[TJ_MODES]; tj__sums many[TJ_MODES / TJ__WIDE]; } load, b;
        tj__spot where; /* the same in both tables */
        int M = m->stress.row * TJ__WIDE;
        tj__find(&m->stress, 3, at, &where);
        tj__many(&m->stress, &where, b.many);
        for (i = 0; i < M; i++) { b.one[i] *= m->factor * inside; load.one[i] = 0; }
        for (k = 0; k < m->terms; k++) {
            double h = dt / m->tau[k], gone = -expm1(-h), ramp = 1 - (h > 1e-4 ? gone / h : 1 - h / 2);
            double left = gone - ramp, keep = 1 - gone, g = m->g[k], *q = state->gone[k];
            for (i = 0; i < M; i++) {
                q[i] = keep * q[i] + left * state->now[i] + ramp * b.one[i];
                load.one[i] += g * q[i];
            }
        }
        memcpy(state->now, b.one, (size_t)M * sizeof(double));
        if (depth > 0) {
            double e[4], deeper;
            tj__loaded(&m->strain, &where, load.many, e);
            deeper = e[0] + e[3] * s / 2;
            f[0] += free_[0] * (inside * e[1] + deeper * z[1]);
            f[1] += free_[1] * (inside * e[2] + deeper * z[2]);
            f[2] -= deeper;
        }
        if (!(f[2] > 0)) f[0] = f[1] = f[2] = 0;
    }
    tj__rub(m, state, p, depth, stiff, f);
    for (a = 0; a < 3; a++) f[a] *= fade;
}

TJ_API void tj_box(const tj_model *m, double box[7]) {
    double at[3], t[6];
    int a;
    for (a = 0; a < 2; a++) { box[a] = m->low[a]; box[2 + a] = m->high[a]; at[a] = (m->low[a] + m->high[a]) / 2; }
    tj__one(&m->touch, 2, at, t);
    box[4] = m->depth; box[5] = m->radius; box[6] = t[0];
}

TJ_API void tj_guard_start(tj_guard *g, double most, double slew, double ramp) {
    memset(g, 0, sizeof *g);
    g->most = most; g->slew = slew; g->ramp = ramp; g->stale = 0.01;
}

TJ_API void tj_safe(tj_guard *g, const double p[3], double age, double dt, double f[3]) {
    double size, share, step[3], change;
    int a, bad = !(age >= 0 && age <= g->stale) || !(dt >= 0);
    g->limited = 0;
    for (a = 0; a < 3; a++) bad |= !isfinite(p[a]) || !isfinite(f[a]);
    if (bad) { /* at once: a force that nobody answers for is taken away without a ramp, and comes back with one */
        g->limited = 8; g->since = 0;
        for (a = 0; a < 3; a++) f[a] = g->last[a] = 0;
        return;
    }
    g->since += dt;
    share = g->ramp > 0 && g->since < g->ramp ? g->since / g->ramp : 1;
    if (share < 1) g->limited |= 4;
    size = share * sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    if (size > g->most) { share *= g->most / size; g->limited |= 1; }
    for (a = 0, change = 0; a < 3; a++) { f[a] *= share; step[a] = f[a] - g->last[a]; change += step[a] * step[a]; }
    change = sqrt(change);
    if (change > g->slew * dt) {
        for (a = 0; a < 3; a++) f[a] = g->last[a] + step[a] * g->slew * dt / change;
        g->limited |= 2;
    }
    for (a = 0; a < 3; a++) g->last[a] = f[a];
}
#endif /* TJ_IMPLEMENTATION */
#endif

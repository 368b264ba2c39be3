/* What this processor can do: memory bandwidth, fused multiply-adds, and the project's hexahedral step written by hand.

   The step is that of `tissuejax.tled` for parallelepipeds (one stress point, hourglass control of Joldes, Wittek &
   Miller 2008, reduced polynomial of order four, K/2 (J-1)^2, gravity, mass damping, fixed nodes), with every shortcut
   that a programmer takes: elements in lanes of a vector, stress without C, nodes kept as (x, y, z, -).
   Compiled twice by `yardstick.py`: REAL is float or double. */

#include <math.h>
#include <stdint.h>

#ifndef REAL
#define REAL float
#endif

enum { LANES = 64 / sizeof(REAL) };
typedef REAL lanes[LANES];

/* a = b + s c, n numbers, `times` over. */
void triad(REAL *restrict a, const REAL *restrict b, const REAL *restrict c, int64_t n, int64_t times) {
  for (int64_t t = 0; t < times; t++) {
    const REAL s = (REAL)1e-3 * (REAL)(t + 1);
    for (int64_t i = 0; i < n; i++) a[i] = b[i] + s * c[i];
    __asm__ volatile("" : : "r"(a) : "memory");
  }
}

/* `times` chains of multiply-adds in 12 independent vectors: 12 * LANES * times of them. */
REAL fused(int64_t times) {
  lanes x[12];
  for (int k = 0; k < 12; k++)
    for (int i = 0; i < LANES; i++) x[k][i] = (REAL)(k + i);
  for (int64_t t = 0; t < times; t++)
    for (int k = 0; k < 12; k++)
      for (int i = 0; i < LANES; i++) x[k][i] = x[k][i] * (REAL)0.999 + (REAL)1e-3;
  REAL sum = 0;
  for (int k = 0; k < 12; k++)
    for (int i = 0; i < LANES; i++) sum += x[k][i];
  return sum;
}

/* Sums and differences of eight nodal values: mean gradient along xi, eta, zeta, then four hourglass modes. */
static inline void to_modes(const lanes *n, lanes *m) {
  for (int i = 0; i < LANES; i++) {
    const REAL s0 = n[1][i] + n[0][i], s1 = n[2][i] + n[3][i], s2 = n[5][i] + n[4][i], s3 = n[6][i] + n[7][i];
    const REAL d0 = n[1][i] - n[0][i], d1 = n[2][i] - n[3][i], d2 = n[5][i] - n[4][i], d3 = n[6][i] - n[7][i];
    const REAL low = s1 - s0, high = s3 - s2, lower = d1 - d0, higher = d3 - d2;
    m[0][i] = (d0 + d1) + (d2 + d3);
    m[1][i] = low + high;
    m[2][i] = (s2 + s3) - (s0 + s1);
    m[3][i] = lower + higher;
    m[4][i] = (d2 + d3) - (d0 + d1);
    m[5][i] = high - low;
    m[6][i] = higher - lower;
  }
}

/* The transpose of `to_modes`. */
static inline void to_nodes(const lanes *m, lanes *n) {
  for (int i = 0; i < LANES; i++) {
    const REAL x = m[0][i], y = m[1][i], z = m[2][i], p = m[3][i], q = m[4][i], r = m[5][i], w = m[6][i];
    const REAL a = x - q, b = p - w, c = x + q, d = p + w;
    const REAL o0 = a - b, o1 = a + b, o2 = c - d, o3 = c + d;
    const REAL e0 = r - y - z, e1 = y - r - z, e2 = z - y - r, e3 = y + r + z;
    n[0][i] = e0 - o0, n[1][i] = e0 + o0, n[3][i] = e1 - o1, n[2][i] = e1 + o1;
    n[4][i] = e2 - o2, n[5][i] = e2 + o2, n[7][i] = e3 - o3, n[6][i] = e3 + o3;
  }
}

/* One group of LANES elements. `at`: the reference numbers, one row of LANES each: 9 gradient, 12 hourglass, stiffening
   and volume. `law`: C10 to C40, K, hourglass stiffness in Pa. */
static void group(const REAL *restrict u, REAL *restrict f, const int32_t *restrict cells, const lanes *restrict at,
                  const REAL *restrict law) {
  const lanes *A = at, *X = at + 9, *stiffening = at + 21, *V = at + 22;
  lanes n[3][8], m[3][7], H[3][3], P[3][3], h[4];
  for (int a = 0; a < 8; a++)
    for (int i = 0; i < LANES; i++) {
      const REAL *here = u + 4 * (int64_t)cells[a * LANES + i];
      n[0][a][i] = here[0], n[1][a][i] = here[1], n[2][a][i] = here[2];
    }
  for (int c = 0; c < 3; c++) {
    to_modes(n[c], m[c]);
    for (int j = 0; j < 3; j++)
      for (int i = 0; i < LANES; i++)
        H[c][j][i] = m[c][0][i] * A[j][i] + m[c][1][i] * A[3 + j][i] + m[c][2][i] * A[6 + j][i];
  }
  for (int i = 0; i < LANES; i++) {
    const REAL a = 1 + H[0][0][i], b = H[0][1][i], c = H[0][2][i], d = H[1][0][i], e = 1 + H[1][1][i], g = H[1][2][i];
    const REAL p = H[2][0][i], q = H[2][1][i], r = 1 + H[2][2][i];
    const REAL k00 = e * r - g * q, k01 = g * p - d * r, k02 = d * q - e * p;
    const REAL k10 = c * q - b * r, k11 = a * r - c * p, k12 = b * p - a * q;
    const REAL k20 = b * g - c * e, k21 = c * d - a * g, k22 = a * e - b * d;
    const REAL J = a * k00 + b * k01 + c * k02;
    const REAL trace = a * a + b * b + c * c + d * d + e * e + g * g + p * p + q * q + r * r;
#ifdef DOUBLE
    const REAL down = exp(-2.0 / 3.0 * log(J));
#else
    const REAL down = expf(-2.0f / 3.0f * logf(J));
#endif
    const REAL x = down * trace - 3;
    const REAL slope = 2 * down * (law[0] + x * (2 * law[1] + x * (3 * law[2] + x * 4 * law[3])));
    const REAL pressure = law[4] * (J - 1) - slope * trace / (3 * J);
    const REAL s = slope * V[0][i], t = pressure * V[0][i];
    P[0][0][i] = s * a + t * k00, P[0][1][i] = s * b + t * k01, P[0][2][i] = s * c + t * k02;
    P[1][0][i] = s * d + t * k10, P[1][1][i] = s * e + t * k11, P[1][2][i] = s * g + t * k12;
    P[2][0][i] = s * p + t * k20, P[2][1][i] = s * q + t * k21, P[2][2][i] = s * r + t * k22;
  }
  for (int c = 0; c < 3; c++) {
    lanes out[7];
    for (int i = 0; i < LANES; i++) {
      const REAL k = law[5] * stiffening[0][i];
      REAL T0 = P[c][0][i], T1 = P[c][1][i], T2 = P[c][2][i];
      for (int a = 0; a < 4; a++) {
        const REAL x0 = X[3 * a][i], x1 = X[3 * a + 1][i], x2 = X[3 * a + 2][i];
        h[a][i] = k * (m[c][3 + a][i] - (x0 * H[c][0][i] + x1 * H[c][1][i] + x2 * H[c][2][i]));
        T0 -= h[a][i] * x0, T1 -= h[a][i] * x1, T2 -= h[a][i] * x2;
        out[3 + a][i] = h[a][i];
      }
      for (int j = 0; j < 3; j++) out[j][i] = A[3 * j][i] * T0 + A[3 * j + 1][i] * T1 + A[3 * j + 2][i] * T2;
    }
    to_nodes(out, n[c]);
  }
  for (int i = 0; i < LANES; i++)
    for (int a = 0; a < 8; a++) {
      REAL *here = f + 4 * (int64_t)cells[a * LANES + i];
      here[0] += n[0][a][i], here[1] += n[1][a][i], here[2] += n[2][a][i];
    }
}

/* `steps` of central differences in velocity form. Arrays of nodes are (N, 4); `inverse` mass is 0 at fixed nodes. */
void run(REAL *restrict u, REAL *restrict v, REAL *restrict f, const REAL *restrict inverse, const int32_t *cells,
         const REAL *at, const REAL *law, const REAL *gravity, REAL step, REAL damping, int64_t nodes, int64_t groups,
         int64_t steps) {
  const REAL half = (REAL)0.5 * damping * step, keep = (1 - half) / (1 + half), give = step / (1 + half);
  for (int64_t t = 0; t < steps; t++) {
    for (int64_t i = 0; i < 4 * nodes; i++) f[i] = 0;
    for (int64_t g = 0; g < groups; g++)
      group(u, f, cells + 8 * LANES * g, (const lanes *)at + 23 * g, law);
    for (int64_t k = 0; k < nodes; k++)
      for (int c = 0; c < 4; c++) {
        const REAL pull = inverse[k] > 0 ? gravity[c] : 0;
        v[4 * k + c] = keep * v[4 * k + c] * (inverse[k] > 0) + give * (pull - f[4 * k + c] * inverse[k]);
        u[4 * k + c] += step * v[4 * k + c];
      }
  }
}

// Fields of arrays whose elements send a carrier each.
//
//   E(t, x) = sum_n w_n exp(+j 2 pi f_n (t - r_n/c)),   r_n = |x - x_n|
//   f_n (t - r_n/c) = [f_n t0 + fc s + o_n s] - [f_n R0/c + fc rho/c + o_n rho/c + f_n d_n/c]
//   d_n = r_n - R = (|p_n|^2 - 2 p_n.v)/(R + r_n)
//
// The brackets are a table over times and one over points, one row per element; the field is their product.
//
// source    Farooq 2009, equation 3.11, with spherical ranges instead of plane waves; docs/theory/fda.md
// symbols   f_n = f0 + offset, Hz; fc the mean of the extreme f_n; o_n = f_n - fc
//           p_n       element from the reference point, m;  v, R  point from there and its length, m
//           t0, s     a block's time and t - t0, s;  R0, rho  a block's range and R - R0, m
//           base      fc s or fc rho/c less whole cycles;  start  f_n t0 or f_n R0/c less whole cycles: from the host
//           beta = o_n/c, kappa = f_n/c, cycles per metre
// macros    VW, FP64 as in the headers
//           DOUBLE    1: tables and sums in float64
//           ROWS      entries of a tile of rows;  USED  of them that are summed, all of them where there are more tiles
//           LANES     entries of a tile of lanes, a multiple of VW
//           FLUSH     elements added plainly before they join the compensated total
//           CHUNK     elements that a work-item of `times` or `paths` takes
// reference: sarcl/reference/equations.py:field

#define REAL64 DOUBLE
#include "common.clh"
#include "doubleword.clh"

// Wide numbers as they are stored: float64, or planes of hi and lo float32, `step` apart.
#if FP64
typedef double stored;
#define PLANE(p, k, step) ((p) + (size_t)(k) * (step))
#define WIDE(p, i, step) LOAD(i, p)
#define WIDE1(p, i, step) ((wv)((p)[i]))
#else
typedef float stored;
#define PLANE(p, k, step) ((p) + 2 * (size_t)(k) * (step))
#define WIDE(p, i, step) w_load(p, i, step)
#define WIDE1(p, i, step) w_load1(p, i, step)
#endif

enum { S_SHIFT, S_BASE };                                       // of a time
enum { V_X, V_Y, V_Z, V_RANGE, V_SHIFT, V_BASE };               // of a point
enum { O_OFFSET, O_START };                                     // of an element, over times
enum { P_X, P_Y, P_Z, P_KAPPA, P_BETA, P_START };               // of an element, over points

static inline void unit_circle(wv cycles, rv *sine, rv *cosine) {
#if DOUBLE
    wv rest = cycles - rint(cycles);
    *sine = sinpi(rest + rest);
    *cosine = cospi(rest + rest);
#else
    iv whole;
    sincos_cycles(w_split(cycles, &whole), sine, cosine);
#endif
}

// Tables are [tile][element][re, im][width]: what a work-item of `add` reads lies together.
static inline size_t entry(int i, int k, int n, int width) {
    size_t at = (size_t)i * VW;
    return (at / width * n + k) * 2 * width + at % width;
}

// exp(+j 2 pi f_n t); global size (entries/VW, elements/CHUNK)
//   entries (2, step), elements (2, n), table
__kernel void times(__global const stored *restrict entries, int step, __global const stored *restrict elements, int n,
                    __global REAL *restrict table, int width) {
    int i = get_global_id(0), from = get_global_id(1) * CHUNK, to = min(n, from + CHUNK);
    wv shift = WIDE(PLANE(entries, S_SHIFT, step), i, step), base = WIDE(PLANE(entries, S_BASE, step), i, step);
    for (int k = from; k < to; k++) {
        wv cycles = w_mul(WIDE1(PLANE(elements, O_OFFSET, n), k, n), shift);
        cycles = w_add(cycles, w_add(base, WIDE1(PLANE(elements, O_START, n), k, n)));
        rv sine, cosine;
        unit_circle(cycles, &sine, &cosine);
        size_t at = entry(i, k, n, width);
        STORE(cosine, 0, table + at);
        STORE(sine, 0, table + at + width);
    }
}

// w_n exp(-j 2 pi f_n r_n/c); global size (entries/VW, elements/CHUNK)
//   entries (6, step), elements (6, n), weights (2, n) re, im
__kernel void paths(__global const stored *restrict entries, int step, __global const stored *restrict elements, int n,
                    __global const REAL *restrict weights, __global REAL *restrict table, int width) {
    int i = get_global_id(0), from = get_global_id(1) * CHUNK, to = min(n, from + CHUNK);
    wv v[3], tiny = w_make((fv)1e-30f, (fv)0);  // no length is zero: a point may stand on an element
    for (int a = 0; a < 3; a++) v[a] = WIDE(PLANE(entries, V_X + a, step), i, step);
    wv range = w_add(WIDE(PLANE(entries, V_RANGE, step), i, step), tiny);
    wv shift = WIDE(PLANE(entries, V_SHIFT, step), i, step), base = WIDE(PLANE(entries, V_BASE, step), i, step);
    for (int k = from; k < to; k++) {
        wv square, cross;
        for (int a = 0; a < 3; a++) {
            wv p = WIDE1(PLANE(elements, P_X + a, n), k, n), between = w_sub(v[a], p);
            wv q = w_mul(between, between), d = w_mul(p, w_add(between, v[a]));
            square = a ? w_add(square, q) : q;
            cross = a ? w_add(cross, d) : d;  // p.(2 v - p)
        }
        wv less = w_div(cross, w_add(range, w_sqrt(square)));  // R - r_n
        wv cycles = w_mul(WIDE1(PLANE(elements, P_KAPPA, n), k, n), less);
        cycles = w_sub(cycles, w_mul(WIDE1(PLANE(elements, P_BETA, n), k, n), shift));
        cycles = w_sub(cycles, w_add(base, WIDE1(PLANE(elements, P_START, n), k, n)));
        rv sine, cosine;
        unit_circle(cycles, &sine, &cosine);
        REAL re = weights[k], im = weights[n + k];
        size_t at = entry(i, k, n, width);
        STORE(re * cosine - im * sine, 0, table + at);
        STORE(re * sine + im * cosine, 0, table + at + width);
    }
}

// sum + error += x
static inline void add_to(rv *sum, rv *error, rv x) {
    rv s = *sum + x, t = s - *sum;
    *error += (*sum - (s - t)) + (x - t);
    *sum = s;
}

// out[row][re, im][lane] = sum_n lane_n row_n; global size (lanes/VW, tiles of rows)
__kernel void add(__global const REAL *restrict lanes, __global const REAL *restrict rows, int n, int n_lanes,
                  __global REAL *restrict out) {
    int i = get_global_id(0), tile = get_global_id(1);
    rv total[2 * USED], error[2 * USED];
    for (int r = 0; r < 2 * USED; r++) total[r] = error[r] = (rv)0;
    for (int from = 0; from < n; from += FLUSH) {
        rv re[USED], im[USED];
        for (int r = 0; r < USED; r++) re[r] = im[r] = (rv)0;
        int to = min(n, from + FLUSH);
        for (int k = from; k < to; k++) {
            size_t at = entry(i, k, n, LANES);
            rv a = LOAD(0, lanes + at), b = LOAD(0, lanes + at + LANES);
            __global const REAL *c = rows + ((size_t)tile * n + k) * 2 * ROWS, *d = c + ROWS;
#pragma unroll
            for (int r = 0; r < USED; r++) {
                re[r] = fma(a, (rv)c[r], fma(-b, (rv)d[r], re[r]));
                im[r] = fma(a, (rv)d[r], fma(b, (rv)c[r], im[r]));
            }
        }
#pragma unroll
        for (int r = 0; r < USED; r++) {
            add_to(total + 2 * r, error + 2 * r, re[r]);
            add_to(total + 2 * r + 1, error + 2 * r + 1, im[r]);
        }
    }
    for (int r = 0; r < 2 * USED; r++)
        STORE(total[r] + error[r], i, out + ((size_t)tile * 2 * USED + r) * n_lanes);
}

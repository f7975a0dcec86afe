// Direct backprojection onto square tiles of a plane, a line of pixels at a time: no gather, sine or cosine per pixel.
//
//   Along a line of pixels the range grows by the same step, so all pixels of the line lie between the samples of a
//   profile taken at that step, at one and the same fraction. For every (tile, pulse) such a profile is made once,
//   carrier included; a pixel then costs LINE_TAPS complex products with weights that its whole line shares.
//
//   delta(i, j) = A_i + j beta + rest_ij,    I_ij += sum_b W_b(i) T(n_i + b + FINE j),
//   T(m) = s~(m beta/FINE) exp(+j 2 pi kappa m beta/FINE),    W_b(i) = w_b(z_i) exp(+j 2 pi kappa (A_i - (n_i + b) beta/FINE))
//
// source    the image equation of sarcl/__init__.py. The part of the curvature that is not in A_i, rest_ij, is that of the pulse in
//           the middle of GROUP pulses; a pulse whose own differs by more than limit_turn cycles, whose position differs by
//           more than limit_place samples or whose step is more than limit_step samples per pixel is added pixel by
//           pixel instead, as are window edges: the planned error holds for every pulse.
// symbols   i, j      line, and pixel in the line, about the tile's reference pixel (SIDE/2, SIDE/2)
//           z_i       where A_i lies between samples of T; w_b weights, interp.clh's table form
//           u, R0, a, w   as in range_phase.clh
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, ORDER, BEAM as in the headers
//           SIDE      of a tile, a multiple of VW;  FINE samples of T per pixel (1, 2, 4 or 8)
//           LINE_TAPS even; LINE_TERMS;  GROUP pulses
//           SLOPE     1: sums of dT/dm too, so that rest_ij moves each pixel's position as well as its phase
//           LOCAL     1: every tile has profiles of its own, about its reference pixel (factorised); 0: pulses' own
// reference: sarcl/reference/backproject.py:backproject

#define RANGE 0
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "range_phase.clh"
#include "line_geometry.clh"

#define VECS (SIDE / VW)
#define PARTS (SLOPE ? 4 : 2)       // of a weight: re, im, and of its slope
#define MOST (2 * SIDE + 2 * VW)    // samples of T per FINE-th phase
// of one pulse, in local memory: T[FINE][re, im][MOST], W[LINE_TAPS][PARTS][SIDE], at[SIDE][LINE_TAPS]
#define T_SIZE (FINE * 2 * MOST)
#define W_SIZE (LINE_TAPS * PARTS * SIDE)
#define AT_SIZE (SIDE * LINE_TAPS)

DEFINE_WEIGHTS(line_weights, LINE_TAPS, LINE_TERMS)

#if SLOPE
// Derivatives of the weights by z.
inline void line_slopes(fv z, __global const float *restrict weights, fv *w) {
    fv z2 = z * z;
#pragma unroll
    for (int k = 0; k < LINE_TAPS / 2; k++) {
        __global const float *c = weights + k * 2 * LINE_TERMS;
        fv even = (fv)((2 * LINE_TERMS - 1) * c[2 * LINE_TERMS - 1]), odd = (fv)(2 * (LINE_TERMS - 1) * c[LINE_TERMS - 1]);
#pragma unroll
        for (int i = LINE_TERMS - 2; i >= 0; i--) even = fma(even, z2, (fv)((2 * i + 1) * c[LINE_TERMS + i]));
#pragma unroll
        for (int i = LINE_TERMS - 2; i >= 1; i--) odd = fma(odd, z2, (fv)(2 * i * c[i]));
        w[k] = fma(z, odd, even);
        w[LINE_TAPS - 1 - k] = fma(z, odd, -even);
    }
}
#endif

inline fv lanes(void) {
#if VW == 8
    return (float8)(0, 1, 2, 3, 4, 5, 6, 7);
#elif VW == 16
    return (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
#else
    return 0;
#endif
}

// i times cycles kept in two parts (line_geometry.clh), less whole cycles of the first
inline fv turns_of(fv i, float turn, float low) {
    fv whole = i * turn;
    return fma(i, (fv)low, whole - nearest(whole));
}

// A group's pulse in the middle, and a pixel's steps: `step_i` from line to line, `step_j` along, m.
typedef struct {
    line mid;
    float step_i, step_j;
    int turned;  // 1: lines run along columns
} group;

inline fv square_i(group s, fv i) { return i * i * (s.step_i * s.step_i); }
inline fv square(group s, fv i, fv j) { return fma(j * j, (fv)(s.step_j * s.step_j), square_i(s, i)); }

// May the pulse have the group's curvature off its lines' middles? Looks where rest_ij is largest: at the corners or half
// way between them.
inline int fits(group shared, line s, float limit_turn, float limit_place) {
    float off = 0, misplaced = 0;
    for (int e = 0; e < 6; e += VW) {
        fv i, j, none = 0;
#pragma unroll
        for (int l = 0; l < VW; l++) {
            ((float *)&i)[l] = ((e + l) % 3 - 1) * (SIDE / 2);
            ((float *)&j)[l] = ((e + l) / 3 % 2 ? 1 : -1) * (SIDE / 2);
        }
        fv qi = square_i(shared, i), q = square(shared, i, j);
        fv centre = bend(s, i, none, qi), rest = bend(s, i, j, q) - centre;
        fv rest_mid = bend(shared.mid, i, j, q) - bend(shared.mid, i, none, qi);
        off = fmax(off, largest(fabs(fma((fv)s.kappa, rest, (fv)(-shared.mid.kappa) * rest_mid))));
        // half of the mean of a line's ends is in the line's position
        fv in_place = 0.25f * (rest + bend(s, i, -j, q) - centre);
        misplaced = fmax(misplaced, largest(fmax(fabs(rest - in_place), fabs(in_place)) * fabs(s.sigma)));
    }
    return off <= limit_turn && misplaced <= limit_place;
}

// Weights of all lines of a pulse, and n_i[]; 0 where a line's samples lie too far off to be kept, as for a steep line.
inline int weigh_lines(group shared, line s, __global const float *restrict weights, __local float *w, iv *n_i) {
    fv lane = lanes();
    float to_line = FINE / s.along, reach = 0;
#pragma unroll
    for (int v = 0; v < VECS; v++) {
        fv i = lane + (fv)(v * VW - SIDE / 2), none = 0, end = (fv)(SIDE / 2);
        fv b = bend(s, i, none, square_i(shared, i)), q = square(shared, i, end);
        fv in_place = 0.25f * (bend(s, i, end, q) + bend(s, i, -end, q)) + (fv)0.5f * b;
        fv place = fma(in_place, (fv)s.sigma, i * s.across);
        fv e = place * to_line - (fv)(0.5f * (LINE_TAPS - 1)), first = nearest(e), z = e - first;
        reach = fmax(reach, largest(fabs(e)));
        n_i[v] = nearest_int(e);
        fv weight[LINE_TAPS];
        line_weights(z, weights, weight);
#if SLOPE
        fv slope[LINE_TAPS];
        line_slopes(z, weights, slope);
#endif
        fv turn = fma(b, (fv)s.kappa, turns_of(i, s.turn_across, s.turn_across_low) + s.turn);
        turn -= nearest(turn);
        turn -= turns_of(first, s.fine, s.fine_low);
        turn -= nearest(turn);
#pragma unroll
        for (int t = 0; t < LINE_TAPS; t++) {
            fv x = turn - (fv)(t * s.fine), sine, cosine;
            x = x - (fv)(t * s.fine_low);
            x -= nearest(x);
            sincos_turns(x, &sine, &cosine);
            STORE(weight[t] * cosine, v, w + PARTS * t * SIDE);
            STORE(weight[t] * sine, v, w + (PARTS * t + 1) * SIDE);
#if SLOPE
            fv per_metre = slope[t] * (to_line * s.sigma);
            STORE(per_metre * cosine, v, w + (PARTS * t + 2) * SIDE);
            STORE(per_metre * sine, v, w + (PARTS * t + 3) * SIDE);
#endif
        }
    }
    return reach <= (float)(FINE * (SIDE / 2 + VW) - LINE_TAPS);
}

// T of a pulse: its profile at a line's step, carrier included. Sample FINE k + a is kept at T[a][k - from].
inline void take_samples(line s, __global const float *restrict row, int stride, int origin,
                         __global const float *restrict table, int from, int vectors, __local float *T) {
    fv lane = lanes();
    for (int a = 0; a < FINE; a++)
        for (int v = 0; v < vectors; v++) {
            fv m = (lane + (fv)(v * VW + from)) * (fv)FINE + (fv)a, g, h, sine, cosine;
            look_up(row, stride, origin, (iv)s.base, fma(m, (fv)(s.along * (1.0f / FINE)), (fv)s.frac), table, &g, &h);
            sincos_turns(turns_of(m, s.fine, s.fine_low), &sine, &cosine);
            STORE(fma(g, cosine, -h * sine), v, T + 2 * a * MOST);
            STORE(fma(g, sine, h * cosine), v, T + (2 * a + 1) * MOST);
        }
}

// Samples, weights and positions of a pulse as the `kept`-th of its group; 0: it does not fit, add it pixel by pixel.
inline int keep(group shared, line s, int kept, __global const float *restrict row, int stride, int origin,
                __global const float *restrict table, __global const float *restrict weights, float limit_turn,
                float limit_place, float limit_step, __local float *T, __local float *W, __local int *at) {
    iv n_i[VECS];
    if (!(fabs(s.along) <= limit_step) || !fits(shared, s, limit_turn, limit_place)) return 0;
    if (!weigh_lines(shared, s, weights, W + kept * W_SIZE, n_i)) return 0;
    int lowest = 1 << 20, highest = -(1 << 20);
    for (int r = 0; r < SIDE; r++) {
        lowest = min(lowest, ((int *)n_i)[r]);
        highest = max(highest, ((int *)n_i)[r]);
    }
    int from = (lowest >> FINE_BITS) - SIDE / 2;
    int vectors = (((highest + LINE_TAPS - 1) >> FINE_BITS) + SIDE / 2 - from + VW) / VW;
    for (int r = 0; r < SIDE; r++) {
#pragma unroll
        for (int b = 0; b < LINE_TAPS; b++) {
            int m = ((int *)n_i)[r] + b;
            at[kept * AT_SIZE + r * LINE_TAPS + b] =
                kept * T_SIZE + (m & (FINE - 1)) * 2 * MOST + (m >> FINE_BITS) - SIDE / 2 - from;
        }
    }
    take_samples(s, row, stride, origin, table, from, vectors, T + kept * T_SIZE);
    return 1;
}

// Sums are scalars made by macros, one for each of SUMS vectors: arrays stay in memory, which costs twice the time.
#if VECS >= 4
#define SUMS 4
#define EACH(what) what(0) what(1) what(2) what(3)
#elif VECS == 2
#define SUMS 2
#define EACH(what) what(0) what(1)
#else
#define SUMS 1
#define EACH(what) what(0)
#endif
#define BEGIN(v) fv re##v = 0, im##v = 0;
#define ADD(v)                                   \
    {                                            \
        fv g = LOAD(v, t), h = LOAD(v, t + MOST); \
        re##v = fma(g, wr, fma(-h, wi, re##v));  \
        im##v = fma(g, wi, fma(h, wr, im##v));   \
        ADD_SLOPE(v)                             \
    }
#define END(v) re[v] = re##v, im[v] = im##v;
#if SLOPE
#define BEGIN_SLOPE(v) fv slope_re##v = 0, slope_im##v = 0;
#define ADD_SLOPE(v)                                         \
    slope_re##v = fma(g, dr, fma(-h, di, slope_re##v));      \
    slope_im##v = fma(g, di, fma(h, dr, slope_im##v));
#define END_SLOPE(v) slope_re[v] = slope_re##v, slope_im[v] = slope_im##v;
#else
#define ADD_SLOPE(v)
#endif

// SUMS vectors of line r from pixel j0 on: the group's pulses, then the curvature they share.
inline void sum_line(group shared, int r, int j0, int kept, __local const float *T, __local const float *W,
                     __local const int *at, fv *re, fv *im) {
    EACH(BEGIN)
#if SLOPE
    fv slope_re[SUMS], slope_im[SUMS];
    EACH(BEGIN_SLOPE)
#endif
    for (int f = 0; f < kept; f++) {
        __local const float *w = W + f * W_SIZE + r;
        __local const int *row_at = at + f * AT_SIZE + r * LINE_TAPS;
#pragma unroll
        for (int b = 0; b < LINE_TAPS; b++) {
            fv wr = (fv)w[PARTS * b * SIDE], wi = (fv)w[(PARTS * b + 1) * SIDE];
#if SLOPE
            fv dr = (fv)w[(PARTS * b + 2) * SIDE], di = (fv)w[(PARTS * b + 3) * SIDE];
#endif
            __local const float *t = T + row_at[b] + j0;
            EACH(ADD)
        }
    }
    EACH(END)
    fv i = (fv)(r - SIDE / 2), none = 0, centre = bend(shared.mid, i, none, square_i(shared, i));
#if SLOPE
    EACH(END_SLOPE)
    fv end = (fv)(SIDE / 2), qe = square(shared, i, end);
    fv in_place = 0.25f * (bend(shared.mid, i, end, qe) + bend(shared.mid, i, -end, qe)) - (fv)0.5f * centre;
#endif
#pragma unroll
    for (int v = 0; v < SUMS; v++) {
        fv j = lanes() + (fv)(j0 + v * VW - SIDE / 2), sine, cosine;
        fv rest = bend(shared.mid, i, j, square(shared, i, j)) - centre, turn = rest * shared.mid.kappa;
#if SLOPE
        re[v] = fma(slope_re[v], rest - in_place, re[v]);
        im[v] = fma(slope_im[v], rest - in_place, im[v]);
#endif
        sincos_turns(turn - nearest(turn), &sine, &cosine);
        fv x = fma(re[v], cosine, -im[v] * sine);
        im[v] = fma(re[v], sine, im[v] * cosine);
        re[v] = x;
    }
}

// One pulse at VW pixels of line i, each at a position and phase of its own.
inline void add_each(group shared, __global const float *restrict record, fv i, fv j, __global const float *restrict row,
                     int stride, int origin, __global const float *restrict table, fv *re, fv *im) {
    line s = load_line(record, shared.turned);
    fv q = square(shared, i, j), b = bend(s, i, j, q), g, h, sine, cosine;
    fv from_tile = fma(b, (fv)s.sigma, fma(i, (fv)s.across, j * s.along));
    fv turn = turns_of(i, s.turn_across, s.turn_across_low) + turns_of(j, s.turn_along, s.turn_along_low);
    turn = fma(b, (fv)s.kappa, turn + s.turn);
    iv inside = (from_tile >= (fv)record[L_NEAR]) & (from_tile <= (fv)record[L_FAR]);
#if BEAM
    fv toward = fma((fv)s.u.y, i, (fv)s.u.x * j);
    fv lit = fma((fv)record[L_BY - shared.turned], i, (fv)record[L_BX + shared.turned] * j);
    lit = fma((fv)-record[L_COS], curvature(s.u, toward, q) - toward, lit) + (fv)record[L_EDGE];
    inside = inside & (lit >= 0);
#endif
    if (as_int(record[L_STATE]) == INSIDE) inside = -1;
    // outside, the position is moved to delay 0, which every profile has
    look_up(row, stride, origin, inside ? (iv)s.base : (iv)0, inside ? from_tile + s.frac : (fv)0.0f, table, &g, &h);
    sincos_turns(turn - nearest(turn), &sine, &cosine);
    g = inside ? g : (fv)0.0f;
    h = inside ? h : (fv)0.0f;
    *re = fma(g, cosine, fma(-h, sine, *re));
    *im = fma(g, sine, fma(h, cosine, *im));
}

// total[i], total[i + step], ... += x, as add_compensated
inline void add_spread(__global float *total, __global float *error, size_t i, int step, fv x) {
    float hi[VW], lo[VW];
#pragma unroll
    for (int l = 0; l < VW; l++) hi[l] = total[i + l * step];
    pair s = exact_sum(LOAD(0, hi), x);
    STORE(s.hi, 0, hi);
    STORE(s.lo, 0, lo);
#pragma unroll
    for (int l = 0; l < VW; l++) {
        total[i + l * step] = hi[l];
        error[i + l * step] += lo[l];
    }
}

// global size (tiles of this block), local size 1. Arguments as of `backproject`; step_x, step_y: m per pixel along j and
// i; weights: of LINE_TAPS taps; skipped (n_tiles), BEAM: (2, n_tiles)
__kernel void backproject_lines(__global const float *restrict profiles, int stride, int origin,
                                __global const float *restrict table, __global const float *restrict weights, int n,
                                int n_used, __global const float *restrict constants, float step_x, float step_y,
                                int first, int n_tiles, float limit_turn, float limit_place, float limit_step,
                                __global float *restrict image, ulong pixels, __global int *restrict skipped,
                                ulong local_offset) {
    __local float T[GROUP * T_SIZE];
    __local float W[GROUP * W_SIZE];
    __local int at[GROUP * AT_SIZE];
    int k = first + get_global_id(0), missed = 0, unlit = 0;
#if LOCAL
    profiles += 2 * (local_offset + (size_t)get_global_id(0) * n_used * stride);
#endif
    profiles += 2 * origin;
    __global const float *c = constants + get_global_id(0) * (size_t)n * N_LINE;
    for (int start = 0; start < n_used; start += GROUP) {
        int fast[GROUP], edge[GROUP], n_fast = 0, n_edge = 0, kept = 0;
        for (int p = start; p < min(start + GROUP, n_used); p++) {
            int state = as_int(c[(size_t)p * N_LINE + L_STATE]);
            if (state == OUTSIDE) missed++;
            else if (state == UNLIT) unlit++;
            else if (state == INSIDE) fast[n_fast++] = p;
            else edge[n_edge++] = p;
        }
        if (n_fast + n_edge == 0) continue;
        __global const float *middle = c + (size_t)(n_fast ? fast[n_fast / 2] : edge[0]) * N_LINE;
        group shared;
        // lines run along the axis on which the range grows faster
        shared.turned = fabs(middle[L_STEP_Y]) > fabs(middle[L_STEP_X]);
        shared.step_i = shared.turned ? step_x : step_y;
        shared.step_j = shared.turned ? step_y : step_x;
        shared.mid = load_line(middle, shared.turned);

        for (int f = 0; f < n_fast; f++) {
            line s = load_line(c + (size_t)fast[f] * N_LINE, shared.turned);
            __global const float *row = profiles + 2 * (size_t)fast[f] * stride;
            if (keep(shared, s, kept, row, stride, origin, table, weights, limit_turn, limit_place, limit_step, T, W, at))
                kept++;
            else
                edge[n_edge++] = fast[f];
        }
        for (int r = 0; r < SIDE; r++)
            for (int j0 = 0; j0 < SIDE; j0 += SUMS * VW) {
                fv re[SUMS], im[SUMS];
                sum_line(shared, r, j0, kept, T, W, at, re, im);
#pragma unroll
                for (int v = 0; v < SUMS; v++) {
                    int j = j0 + v * VW;
                    for (int f = 0; f < n_edge; f++)
                        add_each(shared, c + (size_t)edge[f] * N_LINE, (fv)(r - SIDE / 2), lanes() + (fv)(j - SIDE / 2),
                                 profiles + 2 * (size_t)edge[f] * stride, stride, origin, table, &re[v], &im[v]);
                    size_t pixel = (size_t)k * (SIDE * SIDE) + (shared.turned ? j * SIDE + r : r * SIDE + j);
                    if (shared.turned) {
                        add_spread(image, image + 2 * pixels, pixel, SIDE, re[v]);
                        add_spread(image + pixels, image + 3 * pixels, pixel, SIDE, im[v]);
                    } else {
                        add_compensated(image, image + 2 * pixels, pixel / VW, re[v]);
                        add_compensated(image + pixels, image + 3 * pixels, pixel / VW, im[v]);
                    }
                }
            }
    }
#if !LOCAL
    skipped[k] += missed;
#if BEAM
    skipped[n_tiles + k] += unlit;
#endif
#endif
}

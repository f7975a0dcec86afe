// Direct backprojection onto square tiles of a plane, a line of pixels at a time: no gather, sine or cosine per pixel.
//
//   Along a line of pixels the range grows by the same step, so all pixels of the line lie between the samples of a
//   profile taken at that step, at one and the same fraction. For every (tile, pulse) such a profile is made once,
//   carrier included; a pixel then costs LINE_TAPS complex products with weights that its whole line shares.
//
//   delta(i, j) = A_i + j beta + rest_ij,    I_ij += sum_b W_b(i) T(n_i + b + FINE j),
//   T(m) = s~(m beta/FINE) exp(+j 2 pi kappa m beta/FINE),    W_b(i) = w_b(z_i) exp(+j 2 pi kappa (A_i - (n_i + b) beta/FINE))
//
// source    DESIGN.md, image equation. The part of the curvature that is not in A_i, rest_ij, is that of the pulse in
//           the middle of GROUP pulses; a pulse whose own differs by more than LIMIT_TURN turns or whose place errs by
//           more than LIMIT_PLACE samples is added pixel by pixel instead, as are window edges.
// symbols   i, j      line, and pixel in the line, about the tile's reference pixel (SIDE/2, SIDE/2)
//           z_i       where A_i lies between samples of T; w_b weights, interp.clh's table form
//           u, R0, a, w   as in phase.clh
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, ORDER as in the headers
//           SIDE      of a tile, a multiple of VW;  FINE samples of T a pixel (1, 2, 4 or 8)
//           LINE_TAPS even; LINE_TERMS;  GROUP pulses
//           SLOPE     1: sums of dT/dm too, so that rest_ij moves each pixel's place as well as its phase
//           LOCAL     1: every tile has profiles of its own, about its reference pixel (factorised); 0: pulses' own
// reference: sarcl/reference/backproject.py:backproject

#define RANGE 0
#include "common.clh"
#include "wide.clh"
#include "geometry.clh"
#include "interp.clh"
#include "phase.clh"

// Record of a (tile, pulse).
enum {
    L_UX, L_UY, L_INVERSE, L_R0,       // to the transmitter: components along a column's and a row's step, m; 1/R0, R0
    L_VX, L_VY, L_RX_INVERSE, L_RX_R0,  // to the receiver
    L_TURN, L_FRAC, L_BASE, L_STATE, L_NEAR, L_FAR, L_KAPPA, L_SIGMA,
    L_STEP_X, L_STEP_Y,                // samples a pixel along j and along i
    L_TURN_X, L_TURN_X_LOW, L_TURN_Y, L_TURN_Y_LOW,  // turns a pixel (a FINE-th of it if `fine`), less whole turns
    L_FINE_X, L_FINE_X_LOW, L_FINE_Y, L_FINE_Y_LOW,  // the same of a FINE-th of a pixel
    L_EDGE, L_BX, L_BY, L_COS,         // BEAM: as in geometry.clh, b along a column's and a row's step, m
    N_LINE = BEAM ? 32 : 28
};

inline void put_line(__global float *records, int component, fv value) {
#if VW == 1
    records[component] = value;
#else
    float lane[VW];
    STORE(value, 0, lane);
#pragma unroll
    for (int l = 0; l < VW; l++) records[l * N_LINE + component] = lane[l];
#endif
}

// Turns x + low, |x| <= 1/2, as a multiple of 2^-14, whose products with integers up to 2^10 are exact, and a rest.
inline void put_step(__global float *records, int component, fv x, fv low) {
    fv high = nearest(x * 16384.0f) * (1.0f / 16384.0f);
    put_line(records, component, high);
    put_line(records, component + 1, (x - high) + low);
}

// Projections of the direction to an antenna on the steps of columns and rows, in wide numbers.
inline void project(__global float *out, int first, point d, wv r, __global const float *axes, wv *along_x, wv *along_y) {
    fv R0 = w_float(r);
    wv inverse = w_div(w_make((fv)1, (fv)0), w_add(r, w_make(R0 > 0 ? (fv)0 : (fv)1, (fv)0)));
    point x, y;
    x.x = w_load1(axes, 0, 6); x.y = w_load1(axes, 1, 6); x.z = w_load1(axes, 2, 6);
    y.x = w_load1(axes, 3, 6); y.y = w_load1(axes, 4, 6); y.z = w_load1(axes, 5, 6);
    *along_x = w_mul(w_dot(d, x), inverse);
    *along_y = w_mul(w_dot(d, y), inverse);
    put_line(out, first, w_float(*along_x));
    put_line(out, first + 1, w_float(*along_y));
    put_line(out, first + 2, R0 > 0 ? w_float(inverse) : (fv)0);
    put_line(out, first + 3, R0);
}

// Turns of `along` metres times kappa, less whole turns, in two parts; and of a FINE-th of it.
inline void put_turns(__global float *out, int component, int fine, wv along, wv kappa) {
    iv whole;
    wv turns = w_mul(along, kappa);
    fv part = w_split(turns, &whole);
    // what rounding to float lost
    wv lost = w_sub(w_sub(turns, w_make(TO_FLOAT_INT(whole), (fv)0)), w_make(part, (fv)0));
    put_step(out, component, part, w_float(lost));
    turns = w_mul(turns, w_make((fv)(1.0f / FINE), (fv)0));
    part = w_split(turns, &whole);
    lost = w_sub(w_sub(turns, w_make(TO_FLOAT_INT(whole), (fv)0)), w_make(part, (fv)0));
    put_step(out, fine, part, w_float(lost));
}

// As tile_constants. axes (2, 6): a column's and a row's step, m, hi and lo parts.
__kernel void line_constants(__global const float *restrict pulse, __global const float *restrict tile,
                             float radius, int n, int n_tiles, int first, int skip,
                             __global const float *restrict axes, __global float *restrict out) {
    size_t g = get_global_id(0), k = first + get_global_id(1), lo = (size_t)N_PULSE * n;
    point x;
    x.x = w_load1(tile, k, 3 * (size_t)n_tiles);
    x.y = w_load1(tile + n_tiles, k, 3 * (size_t)n_tiles);
    x.z = w_load1(tile + 2 * n_tiles, k, 3 * (size_t)n_tiles);
    out += (get_global_id(1) * (size_t)n + g * VW) * N_LINE;

    point d;
    wv r, along_x, along_y;
    wv delta = path_difference(load_antenna(pulse, P_TX, g, n, 0), w_load(pulse + P_TR * n, g, lo), x, &r, &d);
    project(out, L_UX, d, r, axes, &along_x, &along_y);
#if BEAM
    point to_tx = d;
    wv tx_r = r;
#endif
#if BISTATIC
    wv one_half = w_make((fv)0.5f, (fv)0), second_x, second_y;
    wv second = path_difference(load_antenna(pulse, P_RX, g, n, 0), w_load(pulse + P_RR * n, g, lo), x, &r, &d);
    project(out, L_VX, d, r, axes, &second_x, &second_y);
    delta = w_mul(w_add(delta, second), one_half);
    along_x = w_mul(w_add(along_x, second_x), one_half);
    along_y = w_mul(w_add(along_y, second_y), one_half);
#endif
    wv zero = w_make((fv)0, (fv)0);
    along_x = w_sub(zero, along_x);
    along_y = w_sub(zero, along_y);

    iv base, unused;
    wv kappa = w_load(pulse + P_KAPPA * n, g, lo), sigma = w_load(pulse + P_SIGMA * n, g, lo);
#if LOCAL
    put_line(out, L_TURN, (fv)0);
    put_line(out, L_FRAC, (fv)0);
    base = 0;
#else
    put_line(out, L_TURN, w_split(w_add(w_mul(delta, kappa), w_load(pulse + P_TURN * n, g, lo)), &unused));
    put_line(out, L_FRAC, w_split(w_add(w_mul(delta, sigma), w_load(pulse + P_PLACE * n, g, lo)), &base));
#if WRAP
    base = base % WRAP;
#endif
#endif
    put_line(out, L_BASE, AS_FLOAT(base));
    put_line(out, L_KAPPA, w_float(kappa));
    put_line(out, L_SIGMA, w_float(sigma));
    put_line(out, L_STEP_X, w_float(w_mul(along_x, sigma)));
    put_line(out, L_STEP_Y, w_float(w_mul(along_y, sigma)));
    put_turns(out, L_TURN_X, L_FINE_X, along_x, kappa);
    put_turns(out, L_TURN_Y, L_FINE_Y, along_y, kappa);

#if LOCAL
    iv state = INSIDE;
#else
    wv near = w_sub(w_load(pulse + P_NEAR * n, g, lo), delta), far = w_sub(w_load(pulse + P_FAR * n, g, lo), delta);
    put_line(out, L_NEAR, w_float(w_mul(near, sigma)));
    put_line(out, L_FAR, w_float(w_mul(far, sigma)));
    fv reach = (fv)(radius * 1.000001f), a = w_float(near), b = w_float(far);
    iv state = ((a <= -reach) & (b >= reach)) ? (iv)INSIDE : (iv)CROSSING;
    if (skip & SKIP_WINDOW) state = ((a > reach) | (b < -reach)) ? (iv)OUTSIDE : state;
#endif
#if BEAM
    wv beam_edge;
    state = beam_state(pulse, g, n, to_tx, tx_r, radius, skip, state, &beam_edge);
    point beam = load_antenna(pulse, P_BX, g, n, 0), step;
    put_line(out, L_EDGE, w_float(beam_edge));
    step.x = w_load1(axes, 0, 6); step.y = w_load1(axes, 1, 6); step.z = w_load1(axes, 2, 6);
    put_line(out, L_BX, w_float(w_dot(beam, step)));
    step.x = w_load1(axes, 3, 6); step.y = w_load1(axes, 4, 6); step.z = w_load1(axes, 5, 6);
    put_line(out, L_BY, w_float(w_dot(beam, step)));
    put_line(out, L_COS, w_float(w_load(pulse + P_COS * n, g, lo)));
#endif
    put_line(out, L_STATE, AS_FLOAT(state));
}

// One pulse of a tile as its lines see it: `across` from line to line, `along` from pixel to pixel.
typedef struct {
    direction u, v;                      // x along a line, y across lines; z unused
    float turn, frac, kappa, sigma;
    int base;
    float along, across;                 // samples a pixel
    float turn_along, turn_along_low, turn_across, turn_across_low, fine, fine_low;
} line;

inline line load_line(__global const float *restrict c, int turned) {
    line s;
    s.u.x = c[L_UX + turned];
    s.u.y = c[L_UY - turned];
    s.u.z = 0;
    s.u.inverse = c[L_INVERSE];
    s.u.R0 = c[L_R0];
    s.v.x = c[L_VX + turned];
    s.v.y = c[L_VY - turned];
    s.v.z = 0;
    s.v.inverse = c[L_RX_INVERSE];
    s.v.R0 = c[L_RX_R0];
    s.turn = c[L_TURN];
    s.frac = c[L_FRAC];
    s.base = as_int(c[L_BASE]);
    s.kappa = c[L_KAPPA];
    s.sigma = c[L_SIGMA];
    s.along = c[L_STEP_X + turned];
    s.across = c[L_STEP_Y - turned];
    s.turn_along = c[L_TURN_X + 2 * turned];
    s.turn_along_low = c[L_TURN_X_LOW + 2 * turned];
    s.turn_across = c[L_TURN_Y - 2 * turned];
    s.turn_across_low = c[L_TURN_Y_LOW - 2 * turned];
    s.fine = c[L_FINE_X + 2 * turned];
    s.fine_low = c[L_FINE_X_LOW + 2 * turned];
    return s;
}

// Curvature of the half path at (i, j), m; qi, qj: squares of the offsets across and along, m^2
inline fv bend(line s, fv i, fv j, fv q) {
    fv a = fma((fv)s.u.y, i, (fv)s.u.x * j);
    fv b = curvature(s.u, a, q);
#if BISTATIC
    fv e = fma((fv)s.v.y, i, (fv)s.v.x * j);
    b = (fv)0.5f * (b + curvature(s.v, e, q));
#endif
    return b;
}

inline void line_weights(fv z, __global const float *restrict weights, fv *w) {
    fv z2 = z * z;
#pragma unroll
    for (int k = 0; k < LINE_TAPS / 2; k++) {
        __global const float *c = weights + k * 2 * LINE_TERMS;
        fv even = (fv)c[LINE_TERMS - 1], odd = (fv)c[2 * LINE_TERMS - 1];
#pragma unroll
        for (int i = LINE_TERMS - 2; i >= 0; i--) {
            even = fma(even, z2, (fv)c[i]);
            odd = fma(odd, z2, (fv)c[LINE_TERMS + i]);
        }
        w[k] = fma(z, odd, even);
        w[LINE_TAPS - 1 - k] = fma(-z, odd, even);
    }
}

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

inline float largest(fv x) {
    float v[VW], m = -INFINITY;
    STORE(x, 0, v);
#pragma unroll
    for (int l = 0; l < VW; l++) m = fmax(m, v[l]);
    return m;
}

#define VECS (SIDE / VW)
#define SUMS (VECS < 4 ? VECS : 4)  // vectors of a line at a time: their sums fit in registers
#define PARTS (SLOPE ? 4 : 2)       // of a weight: re, im, and of its slope
#define MOST (2 * SIDE + 2 * VW)  // samples of T a FINE-th phase

// global size (tiles of this block), local size 1. Arguments as of `backproject`; steps (2): m a pixel along j and i;
// turned: lines run along i instead; weights: of LINE_TAPS taps
__kernel void backproject_lines(__global const float *restrict profiles, int stride, int origin,
                                __global const float *restrict table, __global const float *restrict weights, int n,
                                int n_used, __global const float *restrict constants, float step_x, float step_y,
                                int first, int n_tiles, float limit_turn, float limit_place, __global float *restrict image,
                                ulong pixels, __global int *restrict skipped, ulong offset) {
    __local float T[GROUP * FINE * 2 * MOST];
    __local float W[GROUP * LINE_TAPS * PARTS * SIDE];
    __local int at[GROUP * LINE_TAPS * SIDE];
    int k = first + get_global_id(0), missed = 0, unlit = 0, one_by_one = 0;
#if LOCAL
    profiles += 2 * (offset + (size_t)get_global_id(0) * n_used * stride);
#endif
    __global const float *c = constants + get_global_id(0) * (size_t)n * N_LINE;
    fv lane = lanes();
    for (int start = 0; start < n_used; start += GROUP) {
        int stop = min(start + GROUP, n_used);
        int fast[GROUP], edge[GROUP], n_fast = 0, n_edge = 0;
        for (int p = start; p < stop; p++) {
            int state = as_int(c[(size_t)p * N_LINE + L_STATE]);
            if (state == OUTSIDE) missed++;
#if BEAM
            else if (state == UNLIT) unlit++;
#endif
            else if (state == INSIDE) fast[n_fast++] = p;
            else edge[n_edge++] = p;
        }
        if (n_fast + n_edge == 0) continue;
        int middle = n_fast ? fast[n_fast / 2] : edge[0];
        __global const float *record = c + (size_t)middle * N_LINE;
        int turned = fabs(record[L_STEP_Y]) > fabs(record[L_STEP_X]);
        float step_i = turned ? step_x : step_y, step_j = turned ? step_y : step_x;
        line mid = load_line(record, turned);

        // what each pulse's lines share
        int kept = 0;
        for (int f = 0; f < n_fast; f++) {
            int p = fast[f];
            line s = load_line(c + (size_t)p * N_LINE, turned);
            // rest_ij is largest at the corners or half way between them
            float off = 0, moved = 0;
            for (int e = 0; e < 6; e += VW) {
                fv edge_i, edge_j;
#pragma unroll
                for (int l = 0; l < VW; l++) {
                    ((float *)&edge_i)[l] = ((e + l) % 3 - 1) * (SIDE / 2);
                    ((float *)&edge_j)[l] = ((e + l) / 3 % 2 ? 1 : -1) * (SIDE / 2);
                }
                fv qi = edge_i * edge_i * (step_i * step_i), qe = fma(edge_j * edge_j, (fv)(step_j * step_j), qi), none = 0;
                fv centre = bend(s, edge_i, none, qi), rest = bend(s, edge_i, edge_j, qe) - centre;
                fv rest_mid = bend(mid, edge_i, edge_j, qe) - bend(mid, edge_i, none, qi);
                off = fmax(off, largest(fabs(fma((fv)s.kappa, rest, (fv)(-mid.kappa) * rest_mid))));
                // half of what a line's ends have on average is in the line's place
                fv shared = 0.25f * (rest + bend(s, edge_i, -edge_j, qe) - centre);
                moved = fmax(moved, largest(fmax(fabs(rest - shared), fabs(shared)) * fabs(s.sigma)));
            }
            float to_line = FINE / s.along;

            int lowest = 1 << 20, highest = -(1 << 20);
            float reach = 0;
            __local float *w = W + kept * LINE_TAPS * PARTS * SIDE;
            __local int *row_at = at + kept * LINE_TAPS * SIDE;
            iv n_i[SIDE / VW];
#pragma unroll
            for (int v = 0; v < VECS; v++) {
                fv i = lane + (fv)(v * VW - SIDE / 2);
                fv q = i * i * (fv)(step_i * step_i), none = 0;
                fv b = bend(s, i, none, q);
                fv end = (fv)(SIDE / 2), qj = fma(end * end, (fv)(step_j * step_j), q);
                fv ends = 0.25f * (bend(s, i, end, qj) + bend(s, i, -end, qj)) + (fv)0.5f * b;
                fv place = fma(ends, (fv)s.sigma, i * s.across);
                fv e = place * to_line - (fv)(0.5f * (LINE_TAPS - 1));
                reach = fmax(reach, largest(fabs(e)));
                iv m = nearest_int(e);
                n_i[v] = m;
                fv z = e - nearest(e);
                fv weight[LINE_TAPS];
                line_weights(z, weights, weight);
#if SLOPE
                fv slope[LINE_TAPS];
                line_slopes(z, weights, slope);
#endif
                fv turn = i * s.turn_across;
                turn -= nearest(turn);
                turn = fma(b, (fv)s.kappa, fma(i, (fv)s.turn_across_low, turn + s.turn));
                turn -= nearest(turn);
                fv mf = nearest(e);
                fv back = mf * s.fine;
                back -= nearest(back);
                turn -= fma(mf, (fv)s.fine_low, back);
                turn -= nearest(turn);
                float fine_turn = s.fine + s.fine_low;
#pragma unroll
                for (int t = 0; t < LINE_TAPS; t++) {
                    fv x = turn - (fv)(t * s.fine);
                    x = x - (fv)(t * s.fine_low);
                    x -= nearest(x);
                    fv sine, cosine;
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
            if (!(off <= limit_turn && moved <= limit_place && reach <= (float)(FINE * (SIDE / 2 + VW) - LINE_TAPS))) {
                edge[n_edge++] = p;
                one_by_one++;
                continue;
            }
#pragma unroll
            for (int v = 0; v < VECS; v++) {
#pragma unroll
                for (int l = 0; l < VW; l++) {
                    int m = ((int *)&n_i[v])[l];
                    lowest = min(lowest, m);
                    highest = max(highest, m);
                }
            }
            // sample m = FINE kk + phase of T is kept at T[phase][kk - from]
            int from = (lowest >> FINE_BITS) - SIDE / 2;
            int vectors = (((highest + LINE_TAPS - 1) >> FINE_BITS) + SIDE / 2 - from + VW) / VW;
            __local float *t = T + kept * FINE * 2 * MOST;
            for (int r = 0; r < SIDE; r++) {
#pragma unroll
                for (int b = 0; b < LINE_TAPS; b++) {
                    int m = ((int *)n_i)[r] + b;
                    row_at[r * LINE_TAPS + b] = kept * FINE * 2 * MOST + (m & (FINE - 1)) * 2 * MOST + (m >> FINE_BITS) - SIDE / 2 - from;
                }
            }
            __global const float *row = profiles + 2 * ((size_t)p * stride + origin);
            for (int a = 0; a < FINE; a++)
                for (int v = 0; v < vectors; v++) {
                    fv m = (lane + (fv)(v * VW + from)) * (fv)FINE + (fv)a;
                    fv g, h, sine, cosine;
                    look_up(row, stride, origin, (iv)s.base, fma(m, (fv)(s.along * (1.0f / FINE)), (fv)s.frac), table, &g, &h);
                    fv turn = m * s.fine;
                    turn -= nearest(turn);
                    turn = fma(m, (fv)s.fine_low, turn);
                    turn -= nearest(turn);
                    sincos_turns(turn, &sine, &cosine);
                    STORE(fma(g, cosine, -h * sine), v, t + (2 * a) * MOST);
                    STORE(fma(g, sine, h * cosine), v, t + (2 * a + 1) * MOST);
                }
            kept++;
        }

        for (int r = 0; r < SIDE; r++)
            for (int u = 0; u < VECS; u += SUMS) {
                fv re[SUMS], im[SUMS];
#if SLOPE
                fv slope_re[SUMS], slope_im[SUMS];
#endif
#pragma unroll
                for (int v = 0; v < SUMS; v++) {
                    re[v] = im[v] = 0;
#if SLOPE
                    slope_re[v] = slope_im[v] = 0;
#endif
                }
                for (int f = 0; f < kept; f++) {
                    __local const float *w = W + f * LINE_TAPS * PARTS * SIDE + r;
                    __local const int *row_at = at + (f * SIDE + r) * LINE_TAPS;
#pragma unroll
                    for (int b = 0; b < LINE_TAPS; b++) {
                        fv wr = (fv)w[PARTS * b * SIDE], wi = (fv)w[(PARTS * b + 1) * SIDE];
#if SLOPE
                        fv dr = (fv)w[(PARTS * b + 2) * SIDE], di = (fv)w[(PARTS * b + 3) * SIDE];
#endif
                        __local const float *t = T + row_at[b] + u * VW;
#pragma unroll
                        for (int v = 0; v < SUMS; v++) {
                            fv g = LOAD(v, t), h = LOAD(v, t + MOST);
                            re[v] = fma(g, wr, fma(-h, wi, re[v]));
                            im[v] = fma(g, wi, fma(h, wr, im[v]));
#if SLOPE
                            slope_re[v] = fma(g, dr, fma(-h, di, slope_re[v]));
                            slope_im[v] = fma(g, di, fma(h, dr, slope_im[v]));
#endif
                        }
                    }
                }
                fv i = (fv)(r - SIDE / 2), none = 0;
                fv qi = i * i * (step_i * step_i);
                fv centre = bend(mid, i, none, qi);
#if SLOPE
                fv end = (fv)(SIDE / 2), qe = fma(end * end, (fv)(step_j * step_j), qi);
                fv shared = 0.25f * (bend(mid, i, end, qe) + bend(mid, i, -end, qe)) - (fv)0.5f * centre;
#endif
#pragma unroll
                for (int v = 0; v < SUMS; v++) {
                    fv j = lane + (fv)((u + v) * VW - SIDE / 2);
                    fv q = fma(j * j, (fv)(step_j * step_j), qi);
                    fv rest = bend(mid, i, j, q) - centre, sine, cosine;
#if SLOPE
                    re[v] = fma(slope_re[v], rest - shared, re[v]);
                    im[v] = fma(slope_im[v], rest - shared, im[v]);
#endif
                    fv turn = rest * mid.kappa;
                    turn -= nearest(turn);
                    sincos_turns(turn, &sine, &cosine);
                    fv x = fma(re[v], cosine, -im[v] * sine), y = fma(re[v], sine, im[v] * cosine);
                for (int f = 0; f < n_edge; f++) {
                    __global const float *rec = c + (size_t)edge[f] * N_LINE;
                    line s = load_line(rec, turned);
                    fv b = bend(s, i, j, q);
                    place p;
                    p.from_tile = fma(b, (fv)s.sigma, fma(i, (fv)s.across, j * s.along));
                    p.t = p.from_tile + s.frac;
                    p.base = s.base;
                    fv t1 = i * s.turn_across, t2 = j * s.turn_along;
                    t1 -= nearest(t1);
                    t2 -= nearest(t2);
                    p.turn = fma(b, (fv)s.kappa, fma(i, (fv)s.turn_across_low, j * s.turn_along_low) + t1 + t2 + s.turn);
                    p.turn -= nearest(p.turn);
                    iv inside = (p.from_tile >= (fv)rec[L_NEAR]) & (p.from_tile <= (fv)rec[L_FAR]);
#if BEAM
                    fv toward = fma((fv)s.u.y, i, (fv)s.u.x * j);
                    fv lit = fma((fv)rec[L_BY - turned], i, (fv)rec[L_BX + turned] * j);
                    lit = fma((fv)-rec[L_COS], curvature(s.u, toward, q) - toward, lit) + (fv)rec[L_EDGE];
                    inside = inside & (lit >= 0);
#endif
                    if (as_int(rec[L_STATE]) == INSIDE) inside = -1;
                    p.t = inside ? p.t : (fv)0.0f;
                    p.base = inside ? p.base : (iv)0;
                    fv g, h;
                    look_up(profiles + 2 * ((size_t)edge[f] * stride + origin), stride, origin, p.base, p.t, table, &g, &h);
                    sincos_turns(p.turn, &sine, &cosine);
                    g = inside ? g : (fv)0.0f;
                    h = inside ? h : (fv)0.0f;
                    x = fma(g, cosine, fma(-h, sine, x));
                    y = fma(g, sine, fma(h, cosine, y));
                }
                size_t pixel = (size_t)k * (SIDE * SIDE) + (turned ? (u + v) * VW * SIDE + r : r * SIDE + (u + v) * VW);
                if (!turned) {
                    add_compensated(image, image + 2 * pixels, pixel / VW, x);
                    add_compensated(image + pixels, image + 3 * pixels, pixel / VW, y);
                } else {
#pragma unroll
                    for (int l = 0; l < VW; l++) {
                        size_t at1 = pixel + l * SIDE;
                        float a = image[at1], xx = ((float *)&x)[l], sum = a + xx, d = sum - a;
                        image[at1] = sum;
                        image[at1 + 2 * pixels] += (a - (sum - d)) + (xx - d);
                        a = image[at1 + pixels]; xx = ((float *)&y)[l]; sum = a + xx; d = sum - a;
                        image[at1 + pixels] = sum;
                        image[at1 + 3 * pixels] += (a - (sum - d)) + (xx - d);
                    }
                }
            }
            }
    }
#if !LOCAL
    skipped[k] += missed;
    skipped[n_tiles + k] += one_by_one;
#if BEAM
    skipped[2 * n_tiles + k] += unlit;
#endif
#endif
}

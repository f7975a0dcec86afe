// Records of tiles and pulses: what the points of a tile, or the lines of pixels of a square tile, share for a pulse.
//
// A program of its own, so that it is compiled for the few macros that it depends on: not for every interpolation kernel and
// every length of a profile.
//
// source    geometry.clh, line_geometry.clh
// symbols   delta, kappa, sigma, u, R0   as in geometry.clh;  beta   as in line_geometry.clh
// macros    VW, FP64, BISTATIC, BEAM as in the headers
//           RANGE  1: records hold low parts too; 0: they need none; 3: kappa u in two float32 parts, see range_phase.clh
//           LOCAL  1: every tile has profiles of its own, about its reference point (factorised); 0: pulses' own
//           SHARED  as in line_geometry.clh
// reference: sarcl/reference/geometry.py:half_path

#define ORDER 0  // of curvatures, which no record holds
#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "tile_paths.clh"
#include "line_geometry.clh"

// What a pulse's record of either kernel follows from.
typedef struct {
    point tx, rx;      // from the tile's reference point to the antennas, m
    wv tx_range, rx_range;
    wv delta;          // half path at the reference point less the reference range's, m
    wv kappa, sigma;
} pulse_path;

// Paths of VW pulses, vector g of n pulses, from the transmitter to a tile's reference point x.
static inline pulse_path load_path(__global const float *pulse, size_t g, int n, point x) {
    pulse_path path;
    size_t lo = (size_t)N_PULSE * n;
    path.delta = path_difference(load_antenna(pulse, P_TX, g, n, 0), w_load(pulse + P_TR * n, g, lo), x, &path.tx_range, &path.tx);
    return path;
}

// Adds those from the receiver, once the transmitter's direction is written: fewer registers on GPUs.
static inline void add_receiver(pulse_path *path, __global const float *pulse, size_t g, int n, point x) {
    size_t lo = (size_t)N_PULSE * n;
    wv second = path_difference(load_antenna(pulse, P_RX, g, n, 0), w_load(pulse + P_RR * n, g, lo), x, &path->rx_range, &path->rx);
    path->delta = mean_of(path->delta, second);
}

// Records of points and of lines hold in one order, from a component `first` on: cycles, position (fraction, then the sample's
// number), state, near and far edge of the range window, kappa, sigma. Writes all but state and window.
static inline void put_path(__global float *records, int components, int first, __global const float *pulse, size_t g, int n,
                            pulse_path path, int wrap) {
    size_t lo = (size_t)N_PULSE * n;
    iv base = 0, unused;
    wv cycles = w_add(w_mul(path.delta, path.kappa), w_load(pulse + P_CYCLES * n, g, lo));
    put(records, components, first, LOCAL ? (fv)0 : w_split(cycles, &unused));
    wv position = w_add(w_mul(path.delta, path.sigma), w_load(pulse + P_POSITION * n, g, lo));
    put(records, components, first + C_FRAC - C_CYCLES, LOCAL ? (fv)0 : w_split(position, &base));
    if (!LOCAL && wrap) base = base % wrap;
    put(records, components, first + C_BASE - C_CYCLES, AS_FLOAT(base));
    put(records, components, first + C_KAPPA - C_CYCLES, w_float(path.kappa));
    put(records, components, first + C_SIGMA - C_CYCLES, w_float(path.sigma));
}

// Writes the edges of the range window, in the same order, and returns the state of the tile in it.
static inline iv put_window(__global float *records, int components, int first, __global const float *pulse, size_t g, int n,
                            pulse_path path, float radius, int skip) {
    if (LOCAL) return INSIDE;
    size_t lo = (size_t)N_PULSE * n;
    wv near = w_sub(w_load(pulse + P_NEAR * n, g, lo), path.delta), far = w_sub(w_load(pulse + P_FAR * n, g, lo), path.delta);
    put(records, components, first + C_NEAR - C_CYCLES, w_float(w_mul(near, path.sigma)));
    put(records, components, first + C_FAR - C_CYCLES, w_float(w_mul(far, path.sigma)));
    return window_state(near, far, radius, skip);
}

// Writes the direction of an antenna at d, r off, into records of points; u: the direction, in wide numbers.
static inline void put_direction(__global float *records, int first, int low, point d, wv r, wv *u) {
    fv R0 = w_float(r);
    wv inverse = inverse_of(r);
    u[0] = w_mul(d.x, inverse);
    u[1] = w_mul(d.y, inverse);
    u[2] = w_mul(d.z, inverse);
#pragma unroll
    for (int i = 0; i < 3; i++) {
        put(records, N_CONST, first + i, w_float(u[i]));
        if (HAS_LOW) put(records, N_CONST, low + i, w_low(u[i]));
    }
    put(records, N_CONST, first + 3, R0 > 0 ? w_float(inverse) : (fv)0);
    put(records, N_CONST, first + 4, R0);
}

// Writes -kappa u in two parts: a multiple of the power of two magic/(1.5 2^23), and the rest; and ratios for RANGE 3.
static inline void put_steep(__global float *records, wv kappa, wv sigma, const wv *u, float magic) {
#pragma unroll
    for (int i = 0; i < 3; i++) {
        wv steep = w_sub(w_make((fv)0, (fv)0), w_mul(kappa, u[i]));
        fv high = (w_float(steep) + magic) - magic;
        put(records, N_CONST, C_STEEP + i, high);
        put(records, N_CONST, C_STEEP_LOW + i, w_float(w_sub(steep, w_make(high, (fv)0))));
    }
    put(records, N_CONST, C_RATIO, w_float(w_div(sigma, kappa)));
    put(records, N_CONST, C_METRES, w_float(w_div(w_make((fv)1, (fv)0), kappa)));
}

typedef struct {
    int n, n_tiles, first, skip, wrap;
    float magic;
} tile_constants_numbers;

// Constants that the points of a tile share, for VW pulses per work-item. global size (n/VW, tiles of this call).
//   pulse   (2, N_PULSE, n)         hi and lo parts
//   tile    (2, 3, n_tiles)         reference points about the centre, m, hi and lo parts
//   radius  (n_tiles,)              m, of the points about their reference
//   first   this call's first tile
//   out     (tiles of this call, n, N_CONST)   see the enum above
//   skip    SKIP_WINDOW, SKIP_BEAM: leave tiles out, instead of looking at each of their points
//   wrap    M > 0: profiles repeat every M samples; 0: they do not
//   magic   1.5 2^23 times the step of the high parts of kappa u, a power of two, cycles per metre; where RANGE is 3
__kernel void tile_constants(tile_constants_numbers given, __global const float *restrict pulse,
                             __global const float *restrict tile, __global const float *restrict radius,
                             __global float *restrict out) {
    int n = given.n;
    size_t g = get_global_id(0), k = given.first + get_global_id(1);
    point x = load_point(tile, k, given.n_tiles);
    out += (get_global_id(1) * (size_t)n + g * VW) * N_CONST;  // before the paths: fewer registers on GPUs
    pulse_path path = load_path(pulse, g, n, x);
    wv u[3], v[3];
    put_direction(out, C_UX, C_LOW, path.tx, path.tx_range, u);
    if (BISTATIC) {
        add_receiver(&path, pulse, g, n, x);
        put_direction(out, C_RX, C_RX_LOW, path.rx, path.rx_range, v);
#pragma unroll
        for (int i = 0; i < 3; i++) u[i] = mean_of(u[i], v[i]);
    }
    path.kappa = w_load(pulse + P_KAPPA * n, g, (size_t)N_PULSE * n);
    path.sigma = w_load(pulse + P_SIGMA * n, g, (size_t)N_PULSE * n);
    put_path(out, N_CONST, C_CYCLES, pulse, g, n, path, given.wrap);
    if (RANGE == 3) {
        put_steep(out, path.kappa, path.sigma, u, given.magic);
    } else if (HAS_LOW) {
        put(out, N_CONST, C_KAPPA_LOW, w_low(path.kappa));
        put(out, N_CONST, C_SIGMA_LOW, w_low(path.sigma));
    }
    iv state = put_window(out, N_CONST, C_CYCLES, pulse, g, n, path, radius[k], given.skip);
    if (BEAM) {
        wv edge;
        state = beam_state(pulse, g, n, path.tx, path.tx_range, radius[k], given.skip, state, &edge);
        point gradient = beam_gradient(pulse, g, n, path.tx, path.tx_range);
        put(out, N_CONST, C_EDGE, w_float(edge));
        put(out, N_CONST, C_SLOPE, w_float(gradient.x));
        put(out, N_CONST, C_SLOPE + 1, w_float(gradient.y));
        put(out, N_CONST, C_SLOPE + 2, w_float(gradient.z));
        put(out, N_CONST, C_COS, w_float(w_load(pulse + P_COS * n, g, (size_t)N_PULSE * n)));
    }
    put(out, N_CONST, C_STATE, AS_FLOAT(state));
}

// A column's step (0) or a row's (1), m.
static inline point load_step(__global const float *axes, int which) {
    point step;
    step.x = w_load1(axes, 3 * which, 6);
    step.y = w_load1(axes, 3 * which + 1, 6);
    step.z = w_load1(axes, 3 * which + 2, 6);
    return step;
}

// Projections of the direction to an antenna on the steps of columns and rows, in wide numbers.
static inline void project(__global float *out, int first, point d, wv r, __global const float *axes, wv *along_x, wv *along_y) {
    fv R0 = w_float(r);
    wv inverse = inverse_of(r);
    *along_x = w_mul(w_dot(d, load_step(axes, 0)), inverse);
    *along_y = w_mul(w_dot(d, load_step(axes, 1)), inverse);
    put(out, N_LINE, first, w_float(*along_x));
    put(out, N_LINE, first + 1, w_float(*along_y));
    put(out, N_LINE, first + 2, R0 > 0 ? w_float(inverse) : (fv)0);
    put(out, N_LINE, first + 3, R0);
}

// Writes cycles less whole ones, in two parts: a multiple of 2^-14, whose products with integers up to 2^10 are exact, and the rest.
static inline void put_cycles(__global float *out, int component, wv cycles) {
    iv whole;
    fv part = w_split(cycles, &whole), high = nearest(part * 16384.0f) * (1.0f / 16384.0f);
    wv lost = w_sub(w_sub(cycles, w_make(TO_FLOAT_INT(whole), (fv)0)), w_make(part, (fv)0));  // by rounding to float
    put(out, N_LINE, component, high);
    put(out, N_LINE, component + 1, (part - high) + w_float(lost));
}

// Writes a number in two parts: one of 12 digits, whose products with integers below 2^12 are exact, and the rest.
static inline void put_parts(__global float *out, int component, wv value) {
    fv high = AS_FLOAT(AS_INT(w_float(value)) & (iv)0xFFFFF000);
    put(out, N_LINE, component, high);
    put(out, N_LINE, component + 1, w_float(w_sub(value, w_make(high, (fv)0))));
}

// a/b times FINE; where b is 0, some number that is not used.
static inline wv ratio_of(wv a, wv b, int fine) {
    b = w_add(b, w_make(w_float(b) != 0 ? (fv)0 : (fv)1, (fv)0));
    return w_mul(w_div(a, b), w_make((fv)fine, (fv)0));
}

typedef struct {
    int n, n_tiles, first, skip, wrap, fine;
    float radius;
} line_constants_numbers;

// Constants that the lines of a tile share, for VW pulses per work-item: as tile_constants, with one radius, m, for all tiles.
//   axes    (2, 6)    a column's and a row's step, m, hi and lo parts
//   wrap    M > 0: profiles repeat every M samples; 0: they do not
//   fine    samples of a line per pixel: 1, 2, 4 or 8
__kernel void line_constants(line_constants_numbers given, __global const float *restrict pulse,
                             __global const float *restrict tile, __global const float *restrict axes,
                             __global float *restrict out) {
    int fine = given.fine;
    int n = given.n;
    size_t g = get_global_id(0), k = given.first + get_global_id(1);
    point x = load_point(tile, k, given.n_tiles);
    out += (get_global_id(1) * (size_t)n + g * VW) * N_LINE;  // before the paths: fewer registers on GPUs
    pulse_path path = load_path(pulse, g, n, x);
    wv along_x, along_y, second_x, second_y, zero = w_make((fv)0, (fv)0);
    project(out, L_UX, path.tx, path.tx_range, axes, &along_x, &along_y);
    if (BISTATIC) {
        add_receiver(&path, pulse, g, n, x);
        project(out, L_VX, path.rx, path.rx_range, axes, &second_x, &second_y);
        along_x = mean_of(along_x, second_x);
        along_y = mean_of(along_y, second_y);
    }
    along_x = w_sub(zero, along_x);
    along_y = w_sub(zero, along_y);
    path.kappa = w_load(pulse + P_KAPPA * n, g, (size_t)N_PULSE * n);
    path.sigma = w_load(pulse + P_SIGMA * n, g, (size_t)N_PULSE * n);
    wv kappa = path.kappa, sigma = path.sigma;
    put_path(out, N_LINE, L_CYCLES, pulse, g, n, path, given.wrap);
    put(out, N_LINE, L_STEP_X, w_float(w_mul(along_x, sigma)));
    put(out, N_LINE, L_STEP_Y, w_float(w_mul(along_y, sigma)));
    wv cycles_x = w_mul(along_x, kappa), cycles_y = w_mul(along_y, kappa), part = w_make((fv)(1.0f / fine), (fv)0);
    put_cycles(out, L_CYCLES_X, cycles_x);
    put_cycles(out, L_CYCLES_Y, cycles_y);
    put_cycles(out, L_FINE_X, w_mul(cycles_x, part));
    put_cycles(out, L_FINE_Y, w_mul(cycles_y, part));
    if (SHARED) {
        wv fine_sigma = w_mul(sigma, part);
        put_parts(out, L_STEP, w_mul(along_x, fine_sigma));
        put_parts(out, L_STEP + 2, w_mul(along_y, fine_sigma));
        put_parts(out, L_RATIO, ratio_of(along_y, along_x, fine));
        put_parts(out, L_RATIO + 2, ratio_of(along_x, along_y, fine));
    }
    iv state = put_window(out, N_LINE, L_CYCLES, pulse, g, n, path, given.radius, given.skip);
    if (BEAM) {
        wv edge;
        state = beam_state(pulse, g, n, path.tx, path.tx_range, given.radius, given.skip, state, &edge);
        point gradient = beam_gradient(pulse, g, n, path.tx, path.tx_range);
        put(out, N_LINE, L_EDGE, w_float(edge));
        put(out, N_LINE, L_SLOPE_X, w_float(w_dot(gradient, load_step(axes, 0))));
        put(out, N_LINE, L_SLOPE_Y, w_float(w_dot(gradient, load_step(axes, 1))));
        put(out, N_LINE, L_COS, w_float(w_load(pulse + P_COS * n, g, (size_t)N_PULSE * n)));
    }
    put(out, N_LINE, L_STATE, AS_FLOAT(state));
}

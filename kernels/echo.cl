// Echoes of points, spread into range profiles.
//
//   g_p[m] = sum_k a_k(p) exp(-j 2 pi kappa_p delta_p(x_k)) w(m - sigma_p delta_p(x_k)),   w the kernel of interp.clh
//   s_p(f) = FFT of g_p over the kernel's transform, on the host
//
// source    DESIGN.md, echo equation; type-1 nonuniform FFT in range
// symbols   a_k(p)    amplitude, |a|^2 = radar cross section, m^2; delta, kappa, sigma as in geometry.clh
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, RANGE, ORDER as in the headers
//           TILE      scatterers a tile, a multiple of VW
// reference: sarcl/reference/echo.py:echo

#include "common.clh"
#include "wide.clh"
#include "geometry.clh"
#include "interp.clh"
#include "phase.clh"
#include "rows.clh"

// global size (pulses of this block, splits): work-item (p, s) adds tiles s, s + splits, ... to row (s, p).
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of all tiles
//   scatterers  (2, n_tiles TILE)    re, im of amplitude
//   last        scatterers in the last tile; the rest of it is blank
//   flush       tiles added in float32 before they join the compensated total
//   rows        (splits, n_used, 3, stride, 2)   zeroed by the caller: sum, total, its error; delay 0 at sample `origin`
//   done        (splits, n_used)    scatterers added
__kernel void spread(__global const float *restrict pulse, int n, int n_used,
                     __global const float *restrict constants, __global const float *restrict tile, int n_tiles,
                     __global const float *restrict offsets, int n_offsets,
                     __global const float *restrict scatterers, __global const float *restrict table,
                     int last, int flush, __global float *rows, int stride, int origin, __global int *restrict done) {
    int p = get_global_id(0), split = get_global_id(1), count = 0, added = 0;
    __global float *sum = rows + 6 * ((size_t)split * n_used + p) * stride, *row = sum + 2 * origin;
    for (int k = split; k < n_tiles; k += get_global_size(1)) {
        __global const float *c = constants + (k * (size_t)n + p) * N_CONST;
        int state = as_int(c[C_STATE]);
        if (state == OUTSIDE) continue;
        int real = k == n_tiles - 1 ? last : TILE;
        if (state == INSIDE) count += real;
        for (int i = 0; i < TILE / VW; i++) {
            size_t at_vector = (size_t)k * (TILE / VW) + i;
            offset x = load_offset(offsets, at_vector, n_offsets);
            about_centre(&x, tile, k, n_tiles);
            place at = locate(c, pulse, p, n, x);
            fv re = LOAD(at_vector, scatterers), im = LOAD(at_vector, scatterers + n_offsets);
            if (state == CROSSING) {
                fv inside = keep_inside(c, &at);
                re *= inside;
                im *= inside;
                float seen[VW];
                STORE(inside, 0, seen);
                for (int l = 0; l < VW; l++) count += seen[l] != 0 && i * VW + l < real;
            }
            fv sine, cosine;
            sincos_turns(at.turn, &sine, &cosine);
            fv a = fma(re, cosine, im * sine), b = fma(im, cosine, -re * sine);
            iv j;
            fv w[TAPS];
            tap_weights(first_tap(at.t, at.base, stride, origin, &j), table, w);
            add_taps(row, j, w, a, b);
        }
        if (++added % flush == 0) empty_into_total(sum, stride);
    }
    empty_into_total(sum, stride);
    done[split * n_used + p] = count;
}

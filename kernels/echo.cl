// Echoes of points and facets, spread into range profiles.
//
//   g_p[m] = sum_k a_k(p) exp(-j 2 pi kappa_p delta_p(x_k)) w(m - sigma_p delta_p(x_k)),   w the kernel of interp.clh
//   s_p(f) = FFT of g_p over the kernel's transform, on the host
//
// source    DESIGN.md, echo equation; type-1 nonuniform FFT in range
// symbols   a_k(p)    amplitude, |a|^2 = radar cross section, m^2; delta, kappa, sigma as in geometry.clh
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS, RANGE, ORDER as in the headers
//           FACETS    1: amplitude from normal and aspect; 0: given complex amplitudes
//           TILE      scatterers a tile, a multiple of VW
// reference: sarcl/reference/echo.py:echo

#include "common.clh"
#include "wide.clh"
#include "geometry.clh"
#include "interp.clh"
#include "phase.clh"

#if FACETS
// Cosine between a facet's normal and the direction from it (offset x) to an antenna.
inline fv normal_cosine(direction u, offset x, fv nx, fv ny, fv nz) {
    fv dx = fma((fv)u.x, (fv)u.R0, -x.x), dy = fma((fv)u.y, (fv)u.R0, -x.y), dz = fma((fv)u.z, (fv)u.R0, -x.z);
    return fma(nx, dx, fma(ny, dy, nz * dz)) * rsqrt(fma(dx, dx, fma(dy, dy, dz * dz)));
}

// The one function that carries scattering physics: strength = 2 sqrt(pi)/lambda x reflectivity x area, so that a
// facet at normal incidence has 4 pi area^2/lambda^2. A facet that faces away from either antenna gives nothing.
inline fv facet_amplitude(fv strength, fv cos_tx, fv cos_rx) {
    return strength * sqrt(max(cos_tx, (fv)0.0f) * max(cos_rx, (fv)0.0f));
}
#endif

// Adds (a + j b) w[k] to sample j + k of a row, lane by lane: lanes may meet in one sample.
inline void add_taps(__global float *row, iv j, const fv *w, fv a, fv b) {
#if VW == 1
#pragma unroll
    for (int k = 0; k < TAPS; k++) vstore2(vload2(j + k, row) + (float2)(w[k] * a, w[k] * b), j + k, row);
#else
    int at[VW];
    float re[VW], im[VW], weight[TAPS][VW];
    STORE(j, 0, at);
    STORE(a, 0, re);
    STORE(b, 0, im);
#pragma unroll
    for (int k = 0; k < TAPS; k++) STORE(w[k], 0, weight[k]);
#pragma unroll
    for (int l = 0; l < VW; l++) {
        float4 v = (float4)(re[l], im[l], re[l], im[l]);
#pragma unroll
        for (int k = 0; k < TAPS; k += 2) {
            __global float *q = row + 2 * (at[l] + k);
            float4 tap = (float4)(weight[k][l], weight[k][l], weight[k + 1][l], weight[k + 1][l]);
            vstore4(fma(tap, v, vload4(0, q)), 0, q);
        }
    }
#endif
}

// Adds a row's sum to its compensated total and clears it, so that long sums of like terms do not drift.
inline void empty_into_total(__global float *sum, int stride) {
    __global float *total = sum + 2 * stride, *error = sum + 4 * stride;
    int whole = 2 * stride / VW;
    for (int i = 0; i < whole; i++) {
        add_compensated(total, error, i, LOAD(i, sum));
        STORE((fv)0.0f, i, sum);
    }
    for (int i = whole * VW; i < 2 * stride; i++) {
        float a = total[i], s = a + sum[i], t = s - a;
        error[i] += (a - (s - t)) + (sum[i] - t);
        total[i] = s;
        sum[i] = 0;
    }
}

// global size (pulses of this block, splits): work-item (p, s) adds tiles s, s + splits, ... to row (s, p).
//   pulse, constants, tile, offsets, table   as in backproject.cl, constants of all tiles
//   scatterers  (6, n_tiles TILE)   points: re, im of amplitude; facets: strength, two-sided (1 or 0), normal
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
#if FACETS
        direction u = load_direction(c, C_UX, C_LOW);
#if BISTATIC
        direction v = load_direction(c, C_RX, C_RX_LOW);
#endif
#endif
        for (int i = 0; i < TILE / VW; i++) {
            size_t at_vector = (size_t)k * (TILE / VW) + i;
            offset x = load_offset(offsets, at_vector, n_offsets);
            about_centre(&x, tile, k, n_tiles);
            place at = locate(c, pulse, p, n, x);
            fv re = LOAD(at_vector, scatterers);
#if FACETS
            fv two = LOAD(at_vector, scatterers + n_offsets), nx = LOAD(at_vector, scatterers + 2 * n_offsets),
               ny = LOAD(at_vector, scatterers + 3 * n_offsets), nz = LOAD(at_vector, scatterers + 4 * n_offsets);
            fv cos_tx = normal_cosine(u, x, nx, ny, nz);
            // a two-sided facet turns the side that is lit
            fv turn_over = ((two > 0.5f) & (cos_tx < 0.0f)) ? (fv)-1.0f : (fv)1.0f;
#if BISTATIC
            re = facet_amplitude(re, turn_over * cos_tx, turn_over * normal_cosine(v, x, nx, ny, nz));
#else
            re = facet_amplitude(re, turn_over * cos_tx, turn_over * cos_tx);
#endif
            fv im = 0;
#else
            fv im = LOAD(at_vector, scatterers + n_offsets);
#endif
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

// The two steps of a spectral echo that are no FFT: scatterers spread on a grid over azimuth and slant range, and its
// transform read at the range wavenumbers of every Doppler and radar frequency.
//
//   spread    g[n, m] = sum_k b_k w(n - r_k) w(m - x_k),   m modulo n_columns;  w of interp.clh
//   migrate   y(u, f) = exp(j 2 pi c(u, f)) A(u, f) D(nu) sum_t w_t(z) G[u, l(u, f) + t],   l modulo n_range
//             A(u, f) = sum_q basis_q(f) sum_(i<4) L_i(rest) table_q[cell + i]
//
// source    docs/theory/spectral_echo.md; type-1 and type-2 nonuniform FFTs; Stolt 1978 for the range wavenumbers
// symbols   b_k      complex amplitudes, sorted by tile: those of tile i are start[i] ... start[i + 1] - 1
//           first    (n, 2) int: first row and column that a scatterer is spread over, the column in 0 ... n_columns - 1
//           rest     (n, 2): position between taps, in [-1/2, 1/2]
//           G        (n_u, n_range): transform over both axes
//           l, z     first tap of kappa(u, f) and its position between taps;  c  cycles
//           cell     first of four cells of the table over u/2k, -1: no response;  L_i  cubic Lagrange
//           D        1 over the transform of w over rows, at nu cycles per row: polynomial in nu^2, of 9 coefficients
// macros    VW       1
//           TAPS, TERMS, TILE, GROUPED   as in grid_tile.clh, TILE >= TAPS, n_columns a multiple of it;  NODES  tables
// reference: sarcl/reference/spectral_echo.py:spread, migrate

#include "common.clh"
#include "interp.clh"
#include "grid_tile.clh"

// global size (tiles along a row, rows of tiles), times the group (8, 8) where GROUPED: a work-item, or a group, owns one
// tile of the grid, and adds up its own scatterers and those of the tiles before it.
//   first_tile  row of tiles at which the band begins;  out (rows of the band, n_columns, 2)
__kernel void spread(__global const float *restrict amplitude, __global const int *restrict first,
                     __global const float *restrict rest, __global const int *restrict start,
                     __global const float *restrict table, int n_tiles, int first_tile, __global float *out) {
    int item = ITEM;
    int column = (int)get_global_id(0) / ACROSS, band_row = (int)get_global_id(1) / ACROSS, row = first_tile + band_row;
    TILE_SPACE tile_sums sums;
    clear_tile(&sums);
    for (int across = -1; across <= 0; across++) {
        for (int along = -1; along <= 0; along++) {
            int other = column + along, wrapped = other < 0 ? n_tiles : 0;
            if (row + across < 0) continue;
            int tile = (row + across) * n_tiles + other + wrapped, end = start[tile + 1];
            for (int from = start[tile]; from < end; from += ITEMS) {
                int k = from + item, n_added = min(ITEMS, end - from);
                if (item < n_added) {
                    grid_sample s = {first[2 * k] - TILE * row, first[2 * k + 1] - TILE * (column + wrapped),
                                     rest[2 * k], rest[2 * k + 1], vload2(k, amplitude)};
                    put_sample(&sums, item, s, table);
                }
                add_samples(&sums, n_added);
            }
        }
    }
    size_t width = (size_t)TILE * n_tiles;
    out += 2 * ((size_t)(TILE * band_row) * width + TILE * column);
    for (int k = item; k < TILE * TILE; k += ITEMS)
        vstore2(sum_of_cell(&sums, k / TILE, k % TILE), 0, out + 2 * (k / TILE * width + k % TILE));
}

typedef struct {
    int n_range, n_table;
} migrate_numbers;

// global size (n_f, n_u): work-item computes y at one wavenumber along track and one frequency.
//   out  (n_u, n_f, 2)
__kernel void migrate(migrate_numbers given, __global const float *restrict grid, __global const int *restrict first,
                      __global const float *restrict rest, __global const float *restrict cycles,
                      __global const int *restrict cell, __global const float *restrict cell_rest,
                      __global const float *restrict tables, __global const float *restrict basis,
                      __global const float *restrict flat, __global const float *restrict taps, __global float *out) {
    int n_range = given.n_range, n_table = given.n_table, n = (int)get_global_id(0), n_f = (int)get_global_size(0);
    size_t at = (size_t)get_global_id(1) * n_f + n;
    __global float *to = out + 2 * at;
    to[0] = to[1] = 0;
    if (cell[at] < 0) return;
    float t = cell_rest[at], a_re = 0, a_im = 0;
    float share[4] = {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2,
                      (t + 1) * t * (t - 1) / 6};
    for (int q = 0; q < NODES; q++) {
        __global const float *c = tables + 2 * ((size_t)q * n_table + cell[at]);
        float re = 0, im = 0;
#pragma unroll
        for (int i = 0; i < 4; i++) {
            re = fma(share[i], c[2 * i], re);
            im = fma(share[i], c[2 * i + 1], im);
        }
        a_re = fma(basis[q * n_f + n], re, a_re);
        a_im = fma(basis[q * n_f + n], im, a_im);
    }
    float w[TAPS], re = 0, im = 0, z = rest[at];
    tap_weights(z, taps, w);
    __global const float *row = grid + 2 * (size_t)get_global_id(1) * n_range;
#pragma unroll
    for (int s = 0; s < TAPS; s++) {
        int l = first[at] + s;
        l += l < 0 ? n_range : 0;
        float2 g = vload2(l, row);
        re = fma(w[s], g.s0, re);
        im = fma(w[s], g.s1, im);
    }
    float nu = (first[at] + (z + 0.5f * (TAPS - 1))) / n_range, nu2 = nu * nu, d = flat[8];
#pragma unroll
    for (int i = 7; i >= 0; i--) d = fma(d, nu2, flat[i]);
    float s, c;
    sincos_cycles(cycles[at], &s, &c);
    float w_re = d * (a_re * c - a_im * s), w_im = d * (a_re * s + a_im * c);
    to[0] = re * w_re - im * w_im;
    to[1] = re * w_im + im * w_re;
}

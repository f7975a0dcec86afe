// Absorbing layers (CPML) at both ends of the axis x or y of a Yee grid, as a correction of the vacuum update
// (fdtd_vacuum.cl has those along z). With a the axis, b and c the two after it:
//
//   psi_b <- beta psi_b + gamma d_a F_c,   G_b <- G_b - s psi_b
//   psi_c <- beta psi_c + gamma d_a F_b,   G_c <- G_c + s psi_c
//
// G, F and s are E, H and c dt/dx (d_a the difference to the cell before), or H, E and -c dt/dx (to the cell after).
//
// source    J. A. Roden and S. D. Gedney, Microw. Opt. Technol. Lett. 27 (2000), with kappa = 1
// symbols   to, from  fields G and F;  b, c  where components b and c begin in both;  high, low  offsets of the two
//           cells of d_a F
//           psi       (2, size) floats: psi_b and psi_c of the layers, planes x rows x cells
//           beta, gamma  of each layer, those at the low end first
//           first     first plane;  first_layer  its number in psi
//           n_rows    rows of a plane in psi;  from row split on they are `jump` rows further up in the grid
//           by_row    1: a row has the coefficients of its number; 0: of its plane's
// macros    LANES
// reference: sarcl/reference/fdtd.py:absorb

#include "fdtd.clh"

// global size (1 or vectors of a row, rows / rows_each rounded up, planes)
__kernel void absorb(__global float *restrict to, __global const float *restrict from, __global float *restrict psi,
                     __global const float *restrict beta, __global const float *restrict gamma, int by_row, int b, int c,
                     int high, int low, int size, int start, int plane, int row, int n_rows, int split, int jump,
                     int n_vectors, int rows_each, float s, int first, int first_layer) {
    int i = (int)get_global_id(2), layer = first_layer + i;
    int r_end = min(n_rows, ((int)get_global_id(1) + 1) * rows_each);
    for (int r = (int)get_global_id(1) * rows_each; r < r_end; r++) {
        int of_row = start + (first + i) * plane + (r < split ? r : r + jump) * row;
        lanes keep = (lanes)(beta[by_row ? r : layer]), add = (lanes)(gamma[by_row ? r : layer]);
        for (int v = (int)get_global_id(0); v < n_vectors; v += (int)get_global_size(0)) {
            int at = of_row + LANES * v;
            __global float *memory = psi + (layer * n_rows + r) * n_vectors * LANES + LANES * v;
            lanes d_c = LOAD_LANES(from + c + at + high) - LOAD_LANES(from + c + at + low);
            lanes d_b = LOAD_LANES(from + b + at + high) - LOAD_LANES(from + b + at + low);
            lanes psi_b = fma(add, d_c, keep * LOAD_LANES(memory));
            lanes psi_c = fma(add, d_b, keep * LOAD_LANES(memory + size));
            STORE_LANES(psi_b, memory);
            STORE_LANES(psi_c, memory + size);
            STORE_LANES(fma((lanes)(-s), psi_b, LOAD_LANES(to + b + at)), to + b + at);
            STORE_LANES(fma((lanes)(s), psi_c, LOAD_LANES(to + c + at)), to + c + at);
        }
    }
}

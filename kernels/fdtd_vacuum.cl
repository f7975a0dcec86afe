// One time step of a Yee grid in vacuum: the update of every cell, whatever it holds. Lists correct it afterwards
// (fdtd_lists.cl), and absorbing layers along x and y (fdtd_absorb.cl). Layers along z lie in the first and the last vector
// of a row; they are part of the update, because later these cells would be no longer in the cache.
//
//   E(n + 1)   = E(n) + s curl H(n + 1/2),   Ex += s [(Hz[j] - Hz[j - 1]) - (Hy[k] - Hy[k - 1])]
//   H(n + 1/2) = H(n - 1/2) - s curl E(n),   Hx -= s [(Ez[j + 1] - Ez[j]) - (Ey[k + 1] - Ey[k])];   y, z cyclically
//
// source    K. S. Yee, IEEE Trans. Antennas Propag. 14 (1966); docs/theory/full_wave.md
// symbols   e, h  fields (3, component), layout of fdtd.clh; h is the magnetic field times the impedance of vacuum
//           psi   (2, planes, n_rows, 32) floats: memory of the layers along z, psi_b and psi_c of fdtd_absorb.cl
//           beta, gamma  of these 32 cells;  s  c dt/dx
//           n_planes  planes of the grid;  first  first of those that are updated
//           rows_each  rows that a work-item updates;  n_rows, n_vectors  rows of a plane, vectors of a row
// macros    LANES;  ABSORB  1 where layers absorb
// reference: sarcl/reference/fdtd.py:update_e, update_h, absorb

#include "fdtd.clh"

#define EACH_VECTOR                                                                          \
    int i = first + (int)get_global_id(2);                                                   \
    int j_end = min(n_rows, ((int)get_global_id(1) + 1) * rows_each);                        \
    for (int j = (int)get_global_id(1) * rows_each; j < j_end; j++)                          \
        for (int v = (int)get_global_id(0), at = start + i * plane + j * row + LANES * v; v < n_vectors; \
             v += (int)get_global_size(0), at += LANES * (int)get_global_size(0))

// Corrects the curl's x and y components d_x, d_y by the layers along z, from the differences along z of components y and x
#define ABSORB_Z(dz_y, dz_x)                                                                 \
    int k = LANES * v, from_end = k - LANES * n_vectors + 32;                                \
    if (ABSORB && (k < 16 || from_end >= 16)) {                                              \
        int q = k < 16 ? k : from_end;                                                       \
        __global float *memory_b = psi + (i * n_rows + j) * 32 + q;                          \
        __global float *memory_c = memory_b + n_planes * n_rows * 32;                        \
        lanes keep = LOAD_LANES(beta + q), add = LOAD_LANES(gamma + q);                      \
        lanes psi_b = fma(add, dz_y, keep * LOAD_LANES(memory_b));                           \
        lanes psi_c = fma(add, dz_x, keep * LOAD_LANES(memory_c));                           \
        STORE_LANES(psi_b, memory_b);                                                        \
        STORE_LANES(psi_c, memory_c);                                                        \
        d_x -= psi_b;                                                                        \
        d_y += psi_c;                                                                        \
    }

// global size (1 or vectors of a row, rows / rows_each rounded up, planes), for both kernels
__kernel void update_e(__global float *restrict e, __global const float *restrict h, __global float *restrict psi,
                       __global const float *restrict beta, __global const float *restrict gamma, int component,
                       int start, int plane, int row, int n_planes, int n_rows, int n_vectors, int rows_each, float s,
                       int first) {
    __global const float *hx = h, *hy = h + component, *hz = hy + component;
    __global float *ex = e, *ey = e + component, *ez = ey + component;
    EACH_VECTOR {
        lanes x = LOAD_LANES(hx + at), y = LOAD_LANES(hy + at), z = LOAD_LANES(hz + at);
        lanes dz_y = y - LOAD_LANES(hy + at - 1), dz_x = x - LOAD_LANES(hx + at - 1);
        lanes d_x = (z - LOAD_LANES(hz + at - row)) - dz_y;
        lanes d_y = dz_x - (z - LOAD_LANES(hz + at - plane));
        lanes d_z = (y - LOAD_LANES(hy + at - plane)) - (x - LOAD_LANES(hx + at - row));
        ABSORB_Z(dz_y, dz_x)
        STORE_LANES(fma((lanes)(s), d_x, LOAD_LANES(ex + at)), ex + at);
        STORE_LANES(fma((lanes)(s), d_y, LOAD_LANES(ey + at)), ey + at);
        STORE_LANES(fma((lanes)(s), d_z, LOAD_LANES(ez + at)), ez + at);
    }
}

__kernel void update_h(__global const float *restrict e, __global float *restrict h, __global float *restrict psi,
                       __global const float *restrict beta, __global const float *restrict gamma, int component,
                       int start, int plane, int row, int n_planes, int n_rows, int n_vectors, int rows_each, float s,
                       int first) {
    __global float *hx = h, *hy = h + component, *hz = hy + component;
    __global const float *ex = e, *ey = e + component, *ez = ey + component;
    EACH_VECTOR {
        lanes x = LOAD_LANES(ex + at), y = LOAD_LANES(ey + at), z = LOAD_LANES(ez + at);
        lanes dz_y = LOAD_LANES(ey + at + 1) - y, dz_x = LOAD_LANES(ex + at + 1) - x;
        lanes d_x = (LOAD_LANES(ez + at + row) - z) - dz_y;
        lanes d_y = dz_x - (LOAD_LANES(ez + at + plane) - z);
        lanes d_z = (LOAD_LANES(ey + at + plane) - y) - (LOAD_LANES(ex + at + row) - x);
        ABSORB_Z(dz_y, dz_x)
        STORE_LANES(fma((lanes)(-s), d_x, LOAD_LANES(hx + at)), hx + at);
        STORE_LANES(fma((lanes)(-s), d_y, LOAD_LANES(hy + at)), hy + at);
        STORE_LANES(fma((lanes)(-s), d_z, LOAD_LANES(hz + at)), hz + at);
    }
}

// One time step of a Yee grid in vacuum: the update of every cell, whatever it holds, with layers that absorb (CPML) at its
// sides. Lists correct it afterwards (fdtd_lists.cl).
//
//   E(n + 1)   = E(n) + s curl H(n + 1/2),   curl_x H = (Hz[j] - Hz[j - 1]) - (Hy[k] - Hy[k - 1])
//   H(n + 1/2) = H(n - 1/2) - s curl E(n),   curl_x E = (Ez[j + 1] - Ez[j]) - (Ey[k + 1] - Ey[k]);   y, z cyclically
//
// In layers along an axis a, with b and c the two after it and d_a the differences above, F the field of the curl:
//
//   psi_b <- beta psi_b + gamma d_a F_c,   curl_b <- curl_b - psi_b
//   psi_c <- beta psi_c + gamma d_a F_b,   curl_c <- curl_c + psi_c
//
// source    K. S. Yee, IEEE Trans. Antennas Propag. 14 (1966); J. A. Roden and S. D. Gedney, Microw. Opt. Technol. Lett.
//           27 (2000), with kappa = 1; docs/theory/full_wave.md
// symbols   e, h  fields (3, component), layout of fdtd.clh; h is the magnetic field times the impedance of vacuum
//           psi   memory of the layers along x, y and z, for each of them (2, planes, rows, cells): psi_b and psi_c of
//                 2 thick planes, of 2 thick rows, or of the 32 cells in the first and last vector of each row
//           coefficient  beta of the 2 thick layers, those at the low end first, their gamma; beta of the 32 cells, gamma
//           s  c dt/dx;  n_planes, n_rows, n_vectors  planes of the grid, rows of a plane, vectors of a row
//           first  first of the planes that are updated;  rows_each  rows that a work-item updates
// macros    LANES;  ABSORB  1 where layers absorb
// reference: sarcl/reference/fdtd.py:update_e, update_h, absorb

#include "fdtd.clh"

// The step of the layers in one vector. memory points to psi_b, `size` floats before psi_c.
inline void absorb(__global float *memory, int size, lanes beta, lanes gamma, lanes d_c, lanes d_b, lanes *curl_b,
                   lanes *curl_c) {
    lanes psi_b = fma(gamma, d_c, beta * LOAD_LANES(memory)), psi_c = fma(gamma, d_b, beta * LOAD_LANES(memory + size));
    STORE_LANES(psi_b, memory);
    STORE_LANES(psi_c, memory + size);
    *curl_b -= psi_b;
    *curl_c += psi_c;
}

// Number of a layer, from place p among n: -1 between the layers.
inline int layer_of(int p, int n, int thick) { return p < thick ? p : p >= n - thick ? p - n + 2 * thick : -1; }

// global size (1 or vectors of a row, rows / rows_each rounded up, planes), for both kernels
#define EACH_VECTOR                                                                                          \
    int i = first + (int)get_global_id(2), plane_layer = layer_of(i, n_planes, thick);                       \
    int j_end = min(n_rows, ((int)get_global_id(1) + 1) * rows_each);                                        \
    for (int j = (int)get_global_id(1) * rows_each; j < j_end; j++)                                          \
        for (int v = (int)get_global_id(0), at = start + i * plane + j * row + LANES * v; v < n_vectors;     \
             v += (int)get_global_size(0), at += LANES * (int)get_global_size(0))

// curl of a field from its differences dx_y (of component y along x) ..., with the layers
#define CURL                                                                                                 \
    lanes curl_x = dy_z - dz_y, curl_y = dz_x - dx_z, curl_z = dx_y - dy_x;                                  \
    if (ABSORB) {                                                                                            \
        int cells = LANES * n_vectors, k = LANES * v, row_layer = layer_of(j, n_rows, thick);                \
        int in_plane = n_rows * cells, in_rows = 2 * thick * cells, q = layer_of(k, cells, 16);              \
        __global float *psi_y = psi + 4 * thick * in_plane, *psi_z = psi_y + 2 * n_planes * in_rows;         \
        if (plane_layer >= 0)                                                                                \
            absorb(psi + plane_layer * in_plane + j * cells + k, 2 * thick * in_plane,                       \
                   (lanes)(coefficient[plane_layer]), (lanes)(coefficient[2 * thick + plane_layer]), dx_z,   \
                   dx_y, &curl_y, &curl_z);                                                                  \
        if (row_layer >= 0)                                                                                  \
            absorb(psi_y + i * in_rows + row_layer * cells + k, n_planes * in_rows,                          \
                   (lanes)(coefficient[row_layer]), (lanes)(coefficient[2 * thick + row_layer]), dy_x, dy_z, \
                   &curl_z, &curl_x);                                                                        \
        if (q >= 0)                                                                                          \
            absorb(psi_z + (i * n_rows + j) * 32 + q, n_planes * n_rows * 32,                                \
                   LOAD_LANES(coefficient + 4 * thick + q), LOAD_LANES(coefficient + 4 * thick + 32 + q),    \
                   dz_y, dz_x, &curl_x, &curl_y);                                                            \
    }

__kernel void update_e(__global float *restrict e, __global const float *restrict h, __global float *restrict psi,
                       __global const float *restrict coefficient, int thick, int component, int start, int plane,
                       int row, int n_planes, int n_rows, int n_vectors, int rows_each, float s, int first) {
    __global const float *hx = h, *hy = h + component, *hz = hy + component;
    __global float *ex = e, *ey = e + component, *ez = ey + component;
    EACH_VECTOR {
        lanes x = LOAD_LANES(hx + at), y = LOAD_LANES(hy + at), z = LOAD_LANES(hz + at);
        lanes dx_y = y - LOAD_LANES(hy + at - plane), dx_z = z - LOAD_LANES(hz + at - plane);
        lanes dy_x = x - LOAD_LANES(hx + at - row), dy_z = z - LOAD_LANES(hz + at - row);
        lanes dz_x = x - LOAD_LANES(hx + at - 1), dz_y = y - LOAD_LANES(hy + at - 1);
        CURL
        STORE_LANES(fma((lanes)(s), curl_x, LOAD_LANES(ex + at)), ex + at);
        STORE_LANES(fma((lanes)(s), curl_y, LOAD_LANES(ey + at)), ey + at);
        STORE_LANES(fma((lanes)(s), curl_z, LOAD_LANES(ez + at)), ez + at);
    }
}

__kernel void update_h(__global const float *restrict e, __global float *restrict h, __global float *restrict psi,
                       __global const float *restrict coefficient, int thick, int component, int start, int plane,
                       int row, int n_planes, int n_rows, int n_vectors, int rows_each, float s, int first) {
    __global float *hx = h, *hy = h + component, *hz = hy + component;
    __global const float *ex = e, *ey = e + component, *ez = ey + component;
    EACH_VECTOR {
        lanes x = LOAD_LANES(ex + at), y = LOAD_LANES(ey + at), z = LOAD_LANES(ez + at);
        lanes dx_y = LOAD_LANES(ey + at + plane) - y, dx_z = LOAD_LANES(ez + at + plane) - z;
        lanes dy_x = LOAD_LANES(ex + at + row) - x, dy_z = LOAD_LANES(ez + at + row) - z;
        lanes dz_x = LOAD_LANES(ex + at + 1) - x, dz_y = LOAD_LANES(ey + at + 1) - y;
        CURL
        STORE_LANES(fma((lanes)(-s), curl_x, LOAD_LANES(hx + at)), hx + at);
        STORE_LANES(fma((lanes)(-s), curl_y, LOAD_LANES(hy + at)), hy + at);
        STORE_LANES(fma((lanes)(-s), curl_z, LOAD_LANES(hz + at)), hz + at);
    }
}

// One time step of a Yee grid in vacuum: the update of every cell, whatever it holds, with layers that absorb (CPML) at its
// sides; on CPUs each work-item then corrects its rows by lists (fdtd_lists.clh), while they are in its cache.
//
//   E(n + 1)   = E(n) + s curl H(n + 1/2),   curl_x H = (Hz[j] - Hz[j - 1]) - (Hy[k] - Hy[k - 1])
//   H(n + 1/2) = H(n - 1/2) - s curl E(n),   curl_x E = (Ez[j + 1] - Ez[j]) - (Ey[k + 1] - Ey[k]);   y, z cyclically
//
// In layers along an axis a, with b and c the two after it and d_a the differences above, F the field of the curl:
//
//   psi_b <- beta psi_b + gamma d_a F_c,   curl_b <- curl_b - psi_b
//   psi_c <- beta psi_c + gamma d_a F_b,   curl_c <- curl_c + psi_c
//
// Cells whose fields are zero are left out: those inside conductors, and those ahead of the incident wave.
//
// source    K. S. Yee, IEEE Trans. Antennas Propag. 14 (1966); J. A. Roden and S. D. Gedney, Microw. Opt. Technol. Lett.
//           27 (2000), with kappa = 1; docs/theory/full_wave.md
// symbols   e, h  fields (3, component), layout of fdtd.clh; h is the magnetic field times the impedance of vacuum
//           psi   memory of the layers along x, y and z, for each of them (2, planes, rows, cells): psi_b and psi_c of
//                 2 thick planes, of 2 thick rows, or of the 32 cells in the first and last vector of each row
//           coefficient  beta of the 2 thick layers, those at the low end first, their gamma; beta of the 32 cells, gamma
//           resting (planes, rows, 2) ushort: first cell of each row that is not updated, and first one after these
//           front   number of cells from node 0 to the front of the wave, along its direction;  along_x, along_y, along_z
//                   that direction, along_z not 0: cells beyond the front are not updated, 16 at a time
//           s  c dt/dx;  n_planes, n_rows, n_vectors  planes of the grid, rows of a plane, vectors of a row
//           first, last  planes that are updated, without `last`;  each  rows of a plane, on GPUs cells along x, that a
//                   work-item updates
//           wave_rows (2, groups + 1) int: first entry of each group of `each` rows, groups in the order of planes, in
//                   the two parts of the list of the incident wave;  wave  1: it enters in this step
//           rows    (groups + 1) int: first entry of each group in the list of the target;  others: fdtd_lists.clh
// macros    LANES;  ABSORB  1 where layers absorb;  LISTS  1 where work-items correct their rows
// reference: sarcl/reference/equations.py:update_e, update_h; sarcl/reference/fdtd.py:absorb, edges, faces, incident

#include "fdtd.clh"
#include "fdtd_lists.clh"

// The step of the layers in one vector. memory points to psi_b, `size` floats before psi_c.
static inline void absorb(__global float *memory, int size, lanes beta, lanes gamma, lanes d_c, lanes d_b, lanes *curl_b,
                          lanes *curl_c) {
    lanes psi_b = fma(gamma, d_c, beta * LOAD_LANES(memory)), psi_c = fma(gamma, d_b, beta * LOAD_LANES(memory + size));
    STORE_LANES(psi_b, memory);
    STORE_LANES(psi_c, memory + size);
    *curl_b -= psi_b;
    *curl_c += psi_c;
}

// Number of a layer, from place p among n: -1 between the layers.
static inline int layer_of(int p, int n, int thick) { return p < thick ? p : p >= n - thick ? p - n + 2 * thick : -1; }

// First vector of a row that the wave has reached, and the first one after these; the front is `ahead` cells away along the
// direction of the wave from the first cell of the row.
static inline int2 reached(float ahead, float along_z, int n_vectors) {
    int block = (int)floor(clamp(ahead / along_z, -16.0f, 1e6f) / 16), vectors = 16 / LANES;
    return along_z > 0 ? (int2)(0, min((block + 1) * vectors, n_vectors)) : (int2)(max(block, 0) * vectors, n_vectors);
}

// First cell of row (i, j) that is not updated although the wave has reached it, and the first one after these.
#define HOLE ((int2)(resting[i * n_rows + j].x, resting[i * n_rows + j].y))
// First vector of row (i, j) that the wave has reached, and the first one after these.
#define LIT (front < INFINITY ? reached(front - along_x * i - along_y * j, along_z, n_vectors) : (int2)(0, n_vectors))

#if LISTS
// global size (1, rows / each rounded up, planes), for both kernels: a work-item updates rows, vector by vector
#define EACH_VECTOR                                                                                             \
    int i = given.first + (int)get_global_id(2), any = 0;                                                       \
    int j_end = min(n_rows, ((int)get_global_id(1) + 1) * each);                                                \
    for (int j = (int)get_global_id(1) * each; j < j_end; j++) {                                                \
        int2 lit = LIT, hole = HOLE / LANES;                                                                    \
        any |= lit.x < lit.y;                                                                                   \
        for (int v = lit.x, at = start + i * plane + j * row + LANES * v; v < lit.y; v++, at += LANES) {        \
            if (v >= hole.x && v < hole.y) continue;

#define END_EACH_VECTOR \
    }                   \
    }
#define KEPT(value, place) LOAD_LANES(place)
#define KEEP(value, number)
#else
// global size (cells of a row, rows, planes / each rounded up), for both kernels: a work-item updates cells along x one after
// the other, and keeps the values that the next one needs; work-items beyond the grid do nothing
#define EACH_VECTOR                                                                                             \
    int v = (int)get_global_id(0), j = (int)get_global_id(1), kept = 0;                                         \
    int i = given.first + (int)get_global_id(2) * each, i_end = j < n_rows ? min(given.last, i + each) : 0;     \
    for (int at = start + i * plane + j * row + v; i < i_end; i++, at += plane) {                               \
        int2 lit = LIT, hole = HOLE;                                                                            \
        int past = kept;                                                                                        \
        kept = v >= lit.x && v < lit.y && (v < hole.x || v >= hole.y);                                          \
        if (!kept) continue;

#define END_EACH_VECTOR }
#define KEPT(value, place) (past ? (value) : LOAD_LANES(place))
#define KEEP(value, number) value = number;
#endif

// curl of a field from its differences dx_y (of component y along x) ..., with the layers
#define CURL                                                                                                 \
    lanes curl_x = dy_z - dz_y, curl_y = dz_x - dx_z, curl_z = dx_y - dy_x;                                  \
    if (ABSORB) {                                                                                            \
        int cells = LANES * n_vectors, k = LANES * v, row_layer = layer_of(j, n_rows, thick);                \
        int plane_layer = layer_of(i, n_planes, thick);                                                      \
        int in_plane = n_rows * cells, in_rows = 2 * thick * cells, end = LANES == 1 ? thick : LANES;         \
        int q = k < end ? k : k < cells - end ? -1 : k - cells + 32;                                         \
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

#if LISTS

// The incident wave enters the rows that were updated. No place occurs twice in a part of its list.
#define ENTER(FIELD)                                                                                    \
    int group = i * (int)get_global_size(1) + (int)get_global_id(1);                                    \
    for (int part = 0; any && part < 2 * given.wave; part++) {                                          \
        __global const int *rows = wave_rows + part * (n_planes * (int)get_global_size(1) + 1) + group; \
        for (int l = rows[0]; l < rows[1]; l++)                                                         \
            enter(l, FIELD, wave_at, wave_from, wave_rest, wave_amount, u + given.u_at, given.n_points, \
                  given.quiet_below, given.quiet_above);                                                \
    }

#define LIST_ARGUMENTS(COEFFICIENT)                                                                                      \
    , __global const int *restrict wave_rows, __global const int *restrict wave_at,                                      \
        __global const int *restrict wave_from, __global const float *restrict wave_rest,                                \
        __global const float *restrict wave_amount, __global const float *restrict u, __global const int *restrict rows, \
        __global const int *restrict list_at, __global const float *restrict COEFFICIENT, __global float *restrict old,  \
        __global float *restrict residual
#else
#define LIST_ARGUMENTS(COEFFICIENT)
#endif

#define GRID_ARGUMENTS \
    __global float *restrict psi, __global const float *restrict coefficient, __global const ushort2 *restrict resting

// Of both updates; the last line is read where LISTS.
typedef struct {
    int thick, component, start, plane, row, n_planes, n_rows, n_vectors, each, first, last;
    float s, front, along[3];
    int wave, u_at, n_points, quiet_below, quiet_above, count, record, conducts;
} update_numbers;

// Those of the grid by their own names.
#define GRID_NUMBERS                                                                                                 \
    int thick = given.thick, component = given.component, start = given.start, plane = given.plane, row = given.row; \
    int n_planes = given.n_planes, n_rows = given.n_rows, n_vectors = given.n_vectors, each = given.each;  \
    float s = given.s, front = given.front, along_x = given.along[0], along_y = given.along[1], along_z = given.along[2];

__kernel void update_e(update_numbers given, __global float *restrict e, __global const float *restrict h, GRID_ARGUMENTS
                           LIST_ARGUMENTS(share)) {
    GRID_NUMBERS
    __global const float *hx = h, *hy = h + component, *hz = hy + component;
    __global float *ex = e, *ey = e + component, *ez = ey + component;
    lanes y_before = 0, z_before = 0;
    EACH_VECTOR
            lanes x = LOAD_LANES(hx + at), y = LOAD_LANES(hy + at), z = LOAD_LANES(hz + at);
            lanes dx_y = y - KEPT(y_before, hy + at - plane), dx_z = z - KEPT(z_before, hz + at - plane);
            KEEP(y_before, y)
            KEEP(z_before, z)
            lanes dy_x = x - LOAD_LANES(hx + at - row), dy_z = z - LOAD_LANES(hz + at - row);
            lanes dz_x = x - LOAD_LANES(hx + at - 1), dz_y = y - LOAD_LANES(hy + at - 1);
            CURL
            STORE_LANES(fma((lanes)(s), curl_x, LOAD_LANES(ex + at)), ex + at);
            STORE_LANES(fma((lanes)(s), curl_y, LOAD_LANES(ey + at)), ey + at);
            STORE_LANES(fma((lanes)(s), curl_z, LOAD_LANES(ez + at)), ez + at);
    END_EACH_VECTOR
#if LISTS
    ENTER(e)
    for (int l = rows[group]; any && l < rows[group + 1]; l++)
        edge(l, e, list_at, share, old, residual, given.count, given.record, given.conducts);
#endif
}

__kernel void update_h(update_numbers given, __global const float *restrict e, __global float *restrict h, GRID_ARGUMENTS
                           LIST_ARGUMENTS(weight)) {
    GRID_NUMBERS
    __global float *hx = h, *hy = h + component, *hz = hy + component;
    __global const float *ex = e, *ey = e + component, *ez = ey + component;
    lanes y_after = 0, z_after = 0;
    EACH_VECTOR
            lanes x = LOAD_LANES(ex + at), y = KEPT(y_after, ey + at), z = KEPT(z_after, ez + at);
            y_after = LOAD_LANES(ey + at + plane);
            z_after = LOAD_LANES(ez + at + plane);
            lanes dx_y = y_after - y, dx_z = z_after - z;
            lanes dy_x = LOAD_LANES(ex + at + row) - x, dy_z = LOAD_LANES(ez + at + row) - z;
            lanes dz_x = LOAD_LANES(ex + at + 1) - x, dz_y = LOAD_LANES(ey + at + 1) - y;
            CURL
            STORE_LANES(fma((lanes)(-s), curl_x, LOAD_LANES(hx + at)), hx + at);
            STORE_LANES(fma((lanes)(-s), curl_y, LOAD_LANES(hy + at)), hy + at);
            STORE_LANES(fma((lanes)(-s), curl_z, LOAD_LANES(hz + at)), hz + at);
    END_EACH_VECTOR
#if LISTS
    ENTER(h)
    for (int l = rows[group]; any && l < rows[group + 1]; l++)
        face(l, e, h, list_at, weight, old, residual, given.count, given.record, component, plane, row, s);
#endif
}

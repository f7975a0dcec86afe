// Lists of cells of a Yee grid on GPUs, where each entry is a work-item; on CPUs the vacuum update corrects the rows that it
// has just updated (fdtd_vacuum.cl). And the spectra of what the lists of a target changed, on all devices.
//
//   transform  change_f = sum_b r_b exp(-j omega_f t_b),   sums_f += change_f,   norms: |change_f|^2 and |sums_f|^2
//
// source    docs/theory/full_wave.md
// symbols   as in fdtd_lists.clh;  first, last  entries that are corrected
//           phase     (n_samples, n_frequencies, 2): cosine and minus sine;  sums (n_frequencies, 2, count)
//           norms     (2, n_frequencies, work-items): of the vectors of each work-item
//           begin, stride, each  a work-item takes `each` vectors from begin times its number on, `stride` apart
// macros    LANES     count is a multiple of 16
// reference: sarcl/reference/fdtd.py:edges, faces, incident, transform

#include "fdtd.clh"
#include "fdtd_lists.clh"

typedef struct {
    int count, record, conducts, first;
} edges_numbers;

// global size (last - first), of edges, faces and incident
__kernel void edges(edges_numbers given, __global float *restrict e, __global const int *restrict at,
                    __global const float *restrict share, __global float *restrict old, __global float *restrict residual) {
    edge(given.first + (int)get_global_id(0), e, at, share, old, residual, given.count, given.record, given.conducts);
}

typedef struct {
    int count, record, component, plane, row, first;
    float s;
} faces_numbers;

__kernel void faces(faces_numbers given, __global const float *restrict e, __global float *restrict h,
                    __global const int *restrict at, __global const float *restrict weight, __global float *restrict old,
                    __global float *restrict residual) {
    face(given.first + (int)get_global_id(0), e, h, at, weight, old, residual, given.count, given.record, given.component,
         given.plane, given.row, given.s);
}

typedef struct {
    int u_at, n_points, quiet_below, quiet_above, first;
} incident_numbers;

__kernel void incident(incident_numbers given, __global float *restrict field, __global const int *restrict at,
                       __global const int *restrict from, __global const float *restrict rest,
                       __global const float *restrict amount, __global const float *restrict u) {
    enter(given.first + (int)get_global_id(0), field, at, from, rest, amount, u + given.u_at, given.n_points,
          given.quiet_below, given.quiet_above);
}

static inline float sum_lanes(lanes v) {
#if LANES == 1
    return v;
#else
    float8 a = v.lo + v.hi;
    float4 b = a.lo + a.hi;
    return (b.x + b.y) + (b.z + b.w);
#endif
}

typedef struct {
    int count, n_samples, n_frequencies, begin, stride, each;
} transform_numbers;

// global size (work-items)
__kernel void transform(transform_numbers given, __global const float *restrict residual, __global const float *restrict phase,
                        __global float *restrict sums, __global float *restrict norms) {
    // max: else compilers widen the count where it is loaded, and each step of the loop takes additions more on sm_90
    int count = max(given.count, 0), n_samples = given.n_samples, n_frequencies = given.n_frequencies;
    int item = (int)get_global_id(0), n_items = (int)get_global_size(0);
    for (int f = 0; f < n_frequencies; f++) {
        lanes changed = 0, norm = 0;
        for (int n = 0; n < given.each; n++) {
            int l = LANES * (given.begin * item + given.stride * n);
            if (l >= count) break;
            __global float *sum = sums + 2 * (long)f * count + l;
            lanes re = 0, im = 0;
            for (int b = 0; b < n_samples; b++) {
                lanes r = LOAD_LANES(residual + (long)b * count + l);
                __global const float *turn = phase + 2 * (b * n_frequencies + f);
                re = fma(r, (lanes)(turn[0]), re);
                im = fma(r, (lanes)(turn[1]), im);
            }
            changed = fma(re, re, fma(im, im, changed));
            re += LOAD_LANES(sum);
            im += LOAD_LANES(sum + count);
            norm = fma(re, re, fma(im, im, norm));
            STORE_LANES(re, sum);
            STORE_LANES(im, sum + count);
        }
        norms[f * n_items + item] = sum_lanes(changed);
        norms[(n_frequencies + f) * n_items + item] = sum_lanes(norm);
    }
}

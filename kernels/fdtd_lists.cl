// Everything on a Yee grid that is not vacuum, as lists of cells that correct the vacuum update; and the spectra of what
// they changed. What a correction changes is the equivalent current of the cell: the fields are those that these
// currents radiate in vacuum.
//
//   edges      E <- p E_old + q E,   r = change of E;   conductor p = q = 0;   else, with x = sigma dt/(2 eps):
//              p = (1 - x)/(1 + x) - q,   q = 1/(eps_r (1 + x))
//   faces      H <- H_old - s sum of w E over the four edges,   r = change of H;   w = free length / free area
//   incident   F <- F + amount u(first + position), u interpolated by Lagrange's polynomial through 6 values
//   transform  sums_f += sum_b r_b exp(-j omega_f t_b)
//
// source    S. Dey and R. Mittra, IEEE Microw. Guided Wave Lett. 7 (1997), for faces; docs/theory/full_wave.md
// symbols   at        (count,) int: places in e or h, layout of fdtd.clh, sorted by plane
//           old       (count,): the field before this step;  residual (steps of a block, count)
//           first, last  entries that are corrected;  each  entries of a work-item
//           record    where this step's residuals begin
//           share     (2, count): p, q;   weight (4, count): of the edges c(+b), c, b(+c), b of a face in direction a
//           u         values of one step, the 6 components of each point;  from (count,) int: place of the first of 6
//                     points, their component included: the wave is 0 at all six below quiet_below and above quiet_above
//           rest      (count,): position from the third point
//           phase     (steps, n_frequencies, 2): cosine and minus sine, from first_step on;  sums (n_frequencies, 2, count)
// macros    LANES     count of transform is a multiple of 16
// reference: sarcl/reference/fdtd.py:edges, faces, incident, transform

#include "fdtd.clh"

// global size ((last - first) / each rounded up), of edges, faces and incident
#define EACH_ENTRY                                               \
    for (int l = first + (int)get_global_id(0) * each,           \
             end = min(last, l + each); l < end; l++)

__kernel void edges(__global float *restrict e, __global const int *restrict at, __global const float *restrict share,
                    __global float *restrict old, __global float *restrict residual, int count, int record,
                    int each, int first, int last) {
    EACH_ENTRY {
        float vacuum = e[at[l]], value = share[l] * old[l] + share[count + l] * vacuum;
        e[at[l]] = old[l] = value;
        residual[record + l] = value - vacuum;
    }
}

__kernel void faces(__global const float *restrict e, __global float *restrict h, __global const int *restrict at,
                    __global const float *restrict weight, __global float *restrict old,
                    __global float *restrict residual, int count, int record, int component, int plane, int row, float s,
                    int each, int first, int last) {
    EACH_ENTRY {
        int a = at[l] / component, cell = at[l] - a * component;
        int to_b = a == 0 ? row : a == 1 ? 1 : plane, to_c = a == 0 ? 1 : a == 1 ? plane : row;
        __global const float *e_b = e + (a == 2 ? 0 : a + 1) * component + cell;
        __global const float *e_c = e + (a == 0 ? 2 : a - 1) * component + cell;
        float curl = (weight[l] * e_c[to_b] - weight[count + l] * e_c[0]) -
                     (weight[2 * count + l] * e_b[to_c] - weight[3 * count + l] * e_b[0]);
        float value = old[l] - s * curl, vacuum = h[at[l]];
        h[at[l]] = old[l] = value;
        residual[record + l] = value - vacuum;
    }
}

__kernel void incident(__global float *restrict field, __global const int *restrict at, __global const int *restrict from,
                       __global const float *restrict rest, __global const float *restrict amount,
                       __global const float *restrict u, int u_at, int quiet_below, int quiet_above, int each, int first, int last) {
    EACH_ENTRY {
        if (from[l] < quiet_below || from[l] > quiet_above) continue;
        __global const float *p = u + u_at + from[l];
        float v[6] = {p[0], p[6], p[12], p[18], p[24], p[30]};
        float x = rest[l], a = x + 2, b = x + 1, c = x - 1, d = x - 2, g = x - 3;
        float far_low = v[1] * a - v[0] * b / 5, middle = v[3] * x - v[2] * c, far_high = v[5] * d / 5 - v[4] * g;
        float sum = far_low * x * c * d * g / 24 + middle * a * b * d * g / 12 + far_high * a * b * x * c / 24;
        field[at[l]] += amount[l] * sum;
    }
}

// global size (vectors of the list)
__kernel void transform(__global const float *restrict residual, __global const float *restrict phase,
                        __global float *restrict sums, int count, int first_step, int n_steps,
                        int n_frequencies) {
    phase += 2 * first_step * n_frequencies;
    int l = LANES * (int)get_global_id(0);
    for (int f = 0; f < n_frequencies; f++) {
        __global float *sum = sums + 2 * f * count + l;
        lanes re = LOAD_LANES(sum), im = LOAD_LANES(sum + count);
        for (int b = 0; b < n_steps; b++) {
            lanes r = LOAD_LANES(residual + b * count + l);
            __global const float *turn = phase + 2 * (b * n_frequencies + f);
            re = fma(r, (lanes)(turn[0]), re);
            im = fma(r, (lanes)(turn[1]), im);
        }
        STORE_LANES(re, sum);
        STORE_LANES(im, sum + count);
    }
}

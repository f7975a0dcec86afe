// Factorised echoes: profiles of few pulses about small tiles become those of more pulses, about larger tiles, and are added.
//
//   h_p(m) = sum_v W(p - v) G_v(m)
//   s_p(k_p + m + b) += w_b(z_p) exp(-j 2 pi kappa D_p) h_p(m),     D_p = delta_p(x') - delta_p(x)
//
// The adjoint of merge_subapertures.cl: its first line interpolates between the kept pulses of a tile, its second moves the
// profile to where the scatterers of all tiles within a larger one are added up, or to the pulse's own reference range.
//
// source    quadtree backprojection (McCorkle and Rofheart 1996), transposed
// symbols   x', x     centres of the tile and of the larger one that it lies in, m;  delta, kappa, sigma as in geometry.clh
//           k_p, z_p  sample and fraction of D_p, see interp.clh;  m sample of the tile's profile, 0 at x'
//           W         (rows, taps of W): weights of the kept pulses v around a pulse
// macros    VW, FP64, BISTATIC, WRAP, TAPS, TERMS as in the headers
//           FROM_CENTRE  1: new profiles are the pulses' own, about their reference range; 0: about the larger tile's centre x
//           FILTER_TAPS  of W
//           SPAN         samples of a new profile that a work-group adds up, a multiple of 4
//           ITEMS        work-items of a group
// reference: sarcl/reference/merge.py:expand

#include "common.clh"
#include "doubleword.clh"
#include "geometry.clh"
#include "interp.clh"
#include "subaperture_shift.clh"

typedef struct {
    int n, n_used, n_larger, n_tiles, first;
} moves_numbers;

// global size (n/VW, tiles of this call)
//   pulse   (2, N_PULSE, n)    of the new profiles, see geometry.clh
//   larger  (2, 3, n_larger)   x about the scene's centre, m, hi and lo parts;  tile (2, 3, n_tiles) x'
//   parent  (n_tiles)          which larger tile a tile lies in
//   used    n_used <= n        pulses that are real
//   first   this call's first tile
//   out     (tiles of this call, n_used, N_SHIFT)
__kernel void moves(moves_numbers given, __global const float *restrict pulse, __global const float *restrict larger,
                    __global const float *restrict tile, __global const int *restrict parent,
                    __global const float *restrict table, __global float *restrict out) {
    size_t g = get_global_id(0), k = given.first + get_global_id(1);
    point x = load_point(tile, k, given.n_tiles), c = x;
    if (!FROM_CENTRE) c = load_point(larger, parent[k], given.n_larger);
    subaperture_shift shift = shift_of(pulse, g, given.n, c, x);
    out += (get_global_id(1) * (size_t)given.n_used + g * VW) * N_SHIFT;
    store_shifts(shift, table, min(VW, given.n_used - (int)g * VW), out);
}

// WIDTH floats of interleaved complex numbers
#if VW == 1
#define WIDTH 2
typedef float2 cv;
#define LOAD_CV(p) vload2(0, p)
#define STORE_CV(v, p) vstore2(v, 0, p)
#define TURNED(x) ((float2)(-(x).s1, (x).s0))
#else
#define WIDTH 16
typedef float16 cv;
#define LOAD_CV(p) vload16(0, p)
#define STORE_CV(v, p) vstore16(v, 0, p)
#define TURNED(x) ((x).s1032547698badcfe * (float16)(-1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1))
#endif
#define STEP (WIDTH / 2)  // samples

typedef struct {
    int n_used, first_tile, last_tile, first_larger, first_out, n_kept, stride, reach, new_stride, new_origin, n_planes, plane;
    int first_pulse;
} expand_numbers;

// global size (spans of a new profile times ITEMS, pulses, larger tiles of this call), groups of ITEMS
//   profiles  (tiles first_tile ... last_tile - 1, n_kept, stride, 2): delay 0 of a tile stands at `reach`
//   children  (n_larger + 1) first tile of each larger tile, those of this call from first_larger on
//   moves     (tiles from first_tile on, n_used, N_SHIFT), from `moves`
//   places    (2, pulses of the track), first kept pulse and row of the filter; those of this call begin at first_pulse
//   filter    (rows, FILTER_TAPS): W
//   out       (larger tiles from first_out on, n_used, n_planes, new_stride, 2): added to plane `plane`
__kernel void expand(expand_numbers given, __global const float *restrict profiles, __global const int *restrict children,
                     __global const float *restrict moves, __global const int2 *restrict places,
                     __global const float *restrict filter, __global float *restrict out) {
    __local float h[2 * (SPAN + TAPS - 1) + 2 * WIDTH];
    int item = get_local_id(0), begin = get_group_id(0) * SPAN, p = get_global_id(1);
    int larger = given.first_larger + get_global_id(2), count = min(SPAN, given.new_stride - begin);
    out += 2 * ((((size_t)(larger - given.first_out) * given.n_used + p) * given.n_planes + given.plane) * given.new_stride + begin);
    int2 place = places[given.first_pulse + p];
    __global const float *weight = filter + (size_t)place.y * FILTER_TAPS;
    int last = min(children[larger + 1], given.last_tile);
    for (int k = max(children[larger], given.first_tile); k < last; k++) {
        __global const float *c = moves + ((size_t)(k - given.first_tile) * given.n_used + p) * N_SHIFT;
        // sample of the tile's profile that tap TAPS - 1 moves to the first new sample
        int low = begin - (given.new_origin - given.reach + as_int(c[0])) - (TAPS - 1), high = low + count + TAPS - 1;
        if (high <= 0 || low >= given.stride) continue;
        // new samples first_sum ... last_sum - 1 that the tile's profile reaches, in whole steps
        int first_sum = max(0, -low - (TAPS - 1)) / STEP * STEP;
        int last_sum = min(count, first_sum + (given.stride - low - first_sum + STEP - 1) / STEP * STEP);
        __global const float *from = profiles + 2 * ((size_t)(k - given.first_tile) * given.n_kept + place.x) * given.stride;
        float cosine = c[1], sine = c[2];  // of -2 pi kappa D_p
        for (int i = first_sum + item * STEP; i < last_sum + TAPS - 1; i += ITEMS * STEP) {
            int m = low + i;
            cv sum = 0;
            if (m >= 0 && m + STEP <= given.stride) {
#pragma unroll
                for (int a = 0; a < FILTER_TAPS; a++)
                    sum = fma((cv)weight[a], LOAD_CV(from + 2 * ((size_t)a * given.stride + m)), sum);
                sum = fma(TURNED(sum), (cv)sine, sum * (cv)cosine);
                STORE_CV(sum, h + 2 * i);
            } else {
                for (int l = 0; l < STEP; l++) {
                    float2 one = 0;
                    if (m + l >= 0 && m + l < given.stride)
                        for (int a = 0; a < FILTER_TAPS; a++)
                            one = fma((float2)weight[a], vload2((size_t)a * given.stride + m + l, from), one);
                    vstore2((float2)(one.x * cosine - one.y * sine, one.y * cosine + one.x * sine), i + l, h);
                }
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int i = first_sum + item * STEP; i < last_sum; i += ITEMS * STEP) {
            cv sum = 0;
#pragma unroll
            for (int b = 0; b < TAPS; b++) sum = fma((cv)c[4 + b], LOAD_CV(h + 2 * (i + TAPS - 1 - b)), sum);
            if (i + STEP <= count) {
                STORE_CV(LOAD_CV(out + 2 * i) + sum, out + 2 * i);
            } else {  // the row ends within the vector
                float rest[WIDTH];
                STORE_CV(sum, rest);
                for (int l = 0; l < 2 * (count - i); l++) out[2 * i + l] += rest[l];
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

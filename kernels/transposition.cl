// What comes before and after an FFT of the rows or columns of an array: rows of their own, transforms laid as columns.
//
//   rows      w[k, t] = a[first + k, t]
//   columns   w[k, t] = sum_m a[t + m length, first + k],   as many m as there are rows of a; 0 where there is none
//   lay       b[i, first + k] = v_i W[k, origin + sign i],  modulo length
//
// Backwards (sign -1) the transform has exp(+j ...) and needs no normalisation, as an inverse FFT would. A group of SIDE x SIDE
// work-items transposes a tile in local memory, so that neighbours read and write neighbours.
//
// symbols   a, b, w, W   arrays of complex numbers, re and im interleaved
// macros    SIDE   work-items of a group along each axis
// reference: sarcl/reference/transposition.py:columns, sarcl/reference/transposition.py:lay

// global size (length, count)
//   from  (..., length, 2);  out (count, length, 2)
__kernel void rows(__global const float *restrict from, int first, __global float *restrict out) {
    size_t t = get_global_id(0), k = get_global_id(1), length = get_global_size(0);
    vstore2(vload2((first + k) * length + t, from), k * length + t, out);
}

typedef struct {
    int n_rows, stride, first, length, count;
} columns_numbers;

// global size (length, count), each rounded up to whole groups (SIDE, SIDE)
//   from  (n_rows, stride, 2);  out (count, length, 2)
__kernel void columns(columns_numbers given, __global const float *restrict from, __global float *restrict out) {
    __local float2 tile[SIDE][SIDE + 1];
    int x = get_local_id(0), y = get_local_id(1);
    int t0 = (int)get_global_id(0) - x, k0 = (int)get_global_id(1) - y;
    float2 sum = (float2)(0, 0);
    if (k0 + x < given.count && t0 + y < given.length) {
        for (int row = t0 + y; row < given.n_rows; row += given.length)
            sum += vload2((size_t)row * given.stride + given.first + k0 + x, from);
    }
    tile[y][x] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (k0 + y < given.count && t0 + x < given.length)
        vstore2(tile[x][y], (size_t)(k0 + y) * given.length + t0 + x, out);
}

typedef struct {
    int length, origin, sign, n, count, stride, first;
} lay_numbers;

// global size (count, n), each rounded up to whole groups (SIDE, SIDE)
//   spectra  (count, length, 2);  weights (n): v;  out (n, stride, 2)
__kernel void lay(lay_numbers given, __global const float *restrict spectra, __global const float *restrict weights,
                  __global float *restrict out) {
    __local float2 tile[SIDE][SIDE + 1];
    int x = get_local_id(0), y = get_local_id(1);
    int k0 = (int)get_global_id(0) - x, i0 = (int)get_global_id(1) - y;
    float2 value = (float2)(0, 0);
    if (k0 + y < given.count && i0 + x < given.n) {
        int at = (given.origin + given.sign * (i0 + x)) % given.length;
        value = vload2((size_t)(k0 + y) * given.length + (at < 0 ? at + given.length : at), spectra);
    }
    tile[y][x] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (k0 + x < given.count && i0 + y < given.n) {
        vstore2(weights[i0 + y] * tile[x][y], (size_t)(i0 + y) * given.stride + given.first + k0 + x, out);
    }
}

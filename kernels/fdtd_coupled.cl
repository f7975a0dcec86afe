// Edges of a Yee grid at surfaces of dielectrics that are not along the grid: the inverse permittivity is a tensor there, and
// the change of E along an edge depends on the changes of D along the edges across it, too.
//
//   E_a <- E_a + sum over both nodes of the edge, over the two axes b across it, of
//          w_b(node) (dD_b(before the node) + dD_b(after it)),   dD = s curl H of that edge;   r changes by as much
//
// In lossy bodies the weights are complex, w + v (1 - d)/(1 - d exp(-j omega dt)), whose second part lags behind:
//
//   L_a <- d L_a + (1 - d) sum of v_b (dD_b + dD_b),   which is added to E_a as well
//
// It comes after the correction of the list of edges (fdtd_lists.clh), which has all places of this one.
//
// source    G. R. Werner and J. R. Cary, J. Comput. Phys. 226 (2007): the tensor off its diagonal at nodes, means of four
//           edges;  docs/theory/full_wave_bodies.md
// symbols   at        (n,) int: places in e, layout of fdtd.clh, sorted by plane;  entry  (n,) int: their numbers in the list
//           weight    (8, n): w_b at the node before and after, w_c at the node before and after; then v; b, c: axes after a
//           lagging   (n,): L;  keep  d
//           old       of the list of edges: E after this step;  residual, record  as in fdtd_lists.clh
// macros    none
// reference: sarcl/reference/fdtd.py:couple

typedef struct {
    int n, first, record, component, plane, row;
    float s, keep;
} couple_numbers;

// global size (last - first)
__kernel void couple(couple_numbers given, __global float *restrict e, __global const float *restrict h,
                     __global const int *restrict at, __global const int *restrict entry, __global const float *restrict weight,
                     __global float *restrict lagging, __global float *restrict old, __global float *restrict residual) {
    int l = given.first + (int)get_global_id(0), place = at[l], to = entry[l];
    int a = (place >= given.component) + (place >= 2 * given.component), cell = place - a * given.component;
    int to_a = a == 0 ? given.plane : a == 1 ? given.row : 1;
    int to_b = a == 0 ? given.row : a == 1 ? 1 : given.plane;
    int to_c = a == 0 ? 1 : a == 1 ? given.plane : given.row;
    __global const float *h_a = h + a * given.component + cell;
    __global const float *h_b = h + (a == 2 ? 0 : a + 1) * given.component + cell;
    __global const float *h_c = h + (a == 0 ? 2 : a - 1) * given.component + cell;
    float change = 0, late = 0;
    for (int after = 0; after < 2; after++) {
        int node = after * to_a;
        float curl_b = 0, curl_c = 0;
        for (int side = 0; side < 2; side++) {
            int b = node - side * to_b, c = node - side * to_c;
            curl_b += (h_a[b] - h_a[b - to_c]) - (h_c[b] - h_c[b - to_a]);
            curl_c += (h_b[c] - h_b[c - to_a]) - (h_a[c] - h_a[c - to_b]);
        }
        change += weight[after * given.n + l] * curl_b + weight[(2 + after) * given.n + l] * curl_c;
        late += weight[(4 + after) * given.n + l] * curl_b + weight[(6 + after) * given.n + l] * curl_c;
    }
    late = given.keep * lagging[l] + (1 - given.keep) * given.s * late;
    lagging[l] = late;
    change = given.s * change + late;
    e[place] += change;
    old[to] += change;
    if (given.record >= 0) residual[given.record + to] += change;
}

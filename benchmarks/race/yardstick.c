/* How far the machine goes: the race's bed in plain C, float64. Not a part of the product.

   cc -O3 -march=native -fopenmp -fno-math-errno -fno-trapping-math yardstick.c -lm
   yardstick BED OUT threads warm steps skin rolling blocks
   BED: doubles: count, period x, period y, time step, gravity (3), then the parameters of dem.contact.law of a pair of
   grains (8) and of a grain on the floor (8), then x, y, z, radius and mass of each grain [SI].
   OUT: x, y, z of each grain at the end, in the order of BED. Standard output: seconds and lists made of the timed
   steps; kinetic energy; touching pairs and other rows at the end (one across two parts counts twice); rows looked at
   a step that did not touch; then the threads' seconds, summed: finding contacts, their forces, moving, sorting,
   making lists, waiting for one another.

   What it does, beside sorted grains and half lists:
   - Each thread has one contiguous part of the grains; a pair across two parts is computed by both.
   - Pairs that touch lie in a list of their own, with their history beside them, and leave it only when they open: no
     branch is hard to guess, and no history is searched.
   - Pairs that do not touch lie in boxes by how far apart they were when the lists were made. A box is looked at only
     once the fastest grain has come half as far as that.
   - blocks = 1: touching pairs are computed in blocks (yardstick_blocks.h), so that square roots and divisions are
     vector instructions; 0: one after the other. */
#define _GNU_SOURCE
#include <math.h>
#include <omp.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct { double x, y, z, w; } quad;
typedef struct { int i, j; } pair; /* j with the periodic image in its upper bits */
typedef struct { double two_e, eight_g, damping, friction, rolling, tangential, turning, unused; } law;
typedef struct { pair *rows; int count, room; } box;

#define INLINE static inline __attribute__((always_inline))
#define BOXES 8
#define BITS 26
enum { FINDING, FORCES, MOVING, SORTING, LISTING, WAITING, PHASES };
#define MASK ((1 << BITS) - 1)
#define MOST_THREADS 64
#define WIDE 8 /* doubles in a vector */

typedef struct {
    int start, end;           /* its grains */
    pair *touch;              /* touching pairs, and their history: tangential spring, what the dashpot remembers */
    quad *slide, *roll;
    int count, room;
    box apart[BOXES];
    int *near;                /* grains near the floor */
    quad *near_slide, *near_roll;
    int near_count, near_room;
    long checked;             /* rows looked at in the timed steps */
    double spent[PHASES];     /* [s] */
    double far;               /* largest displacement squared since the lists were made */
    char gap[128]; /* parts of two threads share no cache line */
} part;

static int N, threads, with_rolling, in_blocks;
static double PX, PY, DT, G[3], skin;
static law grain, ground;
static quad *X, *V, *W, *F, *T, *X0, *buffer;
static int *id, *spare, *cell, *cell_start, *head, *next_old, *column;
static double shift[9][4] __attribute__((aligned(32))); /* of the periodic images */
static part parts[MOST_THREADS];
static int nx, ny, nz;
static double bottom, size_x, size_y, size_z;

static void *room(size_t bytes) {
    void *p = NULL;
    if (posix_memalign(&p, 64, bytes + 64)) exit(3);
    memset(p, 0, bytes + 64);
    return p;
}

static void *more(void *old, size_t had, size_t wanted) {
    void *p = room(wanted);
    memcpy(p, old, had);
    free(old);
    return p;
}

/* Threads wait for one another; whoever waits long lets others have the core. */
static atomic_int arrived, round_now;
static void meet(void) {
    int now = atomic_load_explicit(&round_now, memory_order_relaxed);
    if (atomic_fetch_add(&arrived, 1) == threads - 1) {
        atomic_store(&arrived, 0);
        atomic_store(&round_now, now + 1);
        return;
    }
    for (long k = 1; atomic_load_explicit(&round_now, memory_order_acquire) == now; k++)
        if (k > 5000) sched_yield();
}

#include "yardstick_law.h"

static void to_touch(part *p, pair row, quad slide, quad roll) {
    if (p->count + WIDE > p->room) { /* a block reads whole vectors */
        int had = p->room;
        p->room = had ? had * 3 / 2 : 1 << 14;
        p->touch = more(p->touch, had * sizeof(pair), p->room * sizeof(pair));
        p->slide = more(p->slide, had * sizeof(quad), p->room * sizeof(quad));
        p->roll = more(p->roll, had * sizeof(quad), p->room * sizeof(quad));
    }
    p->slide[p->count] = slide, p->roll[p->count] = roll, p->touch[p->count++] = row;
}

/* Row `from` instead of row `to`. */
static void keep_row(part *p, int to, int from) {
    p->touch[to] = p->touch[from], p->slide[to] = p->slide[from], p->roll[to] = p->roll[from];
}

static void to_box(box *b, pair row) {
    if (b->count == b->room) {
        int had = b->room;
        b->room = had ? had * 3 / 2 : 1 << 12;
        b->rows = more(b->rows, had * sizeof(pair), b->room * sizeof(pair));
    }
    b->rows[b->count++] = row;
}

/* Pairs that have come to touch since: out of their box, into the list of those that do. */
static void sieve(part *p, double far) {
    quad none = {0, 0, 0, 0};
    for (int k = 0; k < BOXES && (k == 0 || 2.0 * far >= k * skin / BOXES); k++) {
        box *b = &p->apart[k];
        pair *rows = b->rows;
        p->checked += b->count;
        for (int s = 0; s < b->count;) {
            int i = rows[s].i, bits = rows[s].j, j = bits & MASK, image = bits >> BITS;
            double dx = X[i].x - X[j].x + shift[image][0], dy = X[i].y - X[j].y + shift[image][1];
            double dz = X[i].z - X[j].z, sum = X[i].w + X[j].w;
            if (__builtin_expect(dx * dx + dy * dy + dz * dz < sum * sum, 0)) {
                to_touch(p, rows[s], none, none);
                rows[s] = rows[--b->count];
            } else
                s++;
        }
    }
}

INLINE void push_pairs(part *p, int me, double dt, const int rolling) {
    const int start = p->start, end = p->end, nowhere = N + me;
    const quad *restrict x = X, *restrict v = V, *restrict w = W;
    quad *restrict f = F, *restrict t = T;
    law own = grain;
    for (int s = 0; s < p->count;) {
        int i = p->touch[s].i, bits = p->touch[s].j, j = bits & MASK, image = bits >> BITS;
        double dx = x[i].x - x[j].x + shift[image][0], dy = x[i].y - x[j].y + shift[image][1], dz = x[i].z - x[j].z;
        double sum = x[i].w + x[j].w, square = dx * dx + dy * dy + dz * dz;
        if (__builtin_expect(!(square < sum * sum), 0)) { /* it has opened */
            to_box(&p->apart[0], p->touch[s]);
            keep_row(p, s, --p->count);
            continue;
        }
        double length = sqrt(square), overlap = sum - length, mi = v[i].w, mj = v[j].w, both = mi + mj;
        double inverse = 1.0 / (length * sum * both), by_length = sum * both * inverse;
        double nx = dx * by_length, ny = dy * by_length, nz = dz * by_length;
        double radius = x[i].w * x[j].w * (length * both * inverse), mass = mi * mj * (length * sum * inverse);
        double arm_i = x[i].w - 0.5 * overlap, arm_j = x[j].w - 0.5 * overlap;
        double vx = v[i].x - v[j].x, vy = v[i].y - v[j].y, vz = v[i].z - v[j].z;
        double vn = vx * nx + vy * ny + vz * nz;
        double h = 0.5 * dt * by_length, back = 0.25 * dt * vn, bi = arm_i - back, bj = arm_j - back;
        double ax = bi * w[i].x + bj * w[j].x, ay = bi * w[i].y + bj * w[j].y, az = bi * w[i].z + bj * w[j].z;
        double grow = 1.0 + h * vn;
        double tx = grow * (vx - vn * nx) - (ay * nz - az * ny), ty = grow * (vy - vn * ny) - (az * nx - ax * nz);
        double tz = grow * (vz - vn * nz) - (ax * ny - ay * nx);
        double fx, fy, fz, load, k_t, a, root;
        contact(&own, dt, nx, ny, nz, vn, tx, ty, tz, overlap, radius, mass, &p->slide[s], &fx, &fy, &fz, &load, &k_t,
                &a, &root);
        double qx = fy * nz - fz * ny, qy = fz * nx - fx * nz, qz = fx * ny - fy * nx;
        quad turn = {0, 0, 0, 0};
        if (rolling)
            turn = turning(&own, dt, nx, ny, nz, (quad){w[i].x - w[j].x, w[i].y - w[j].y, w[i].z - w[j].z, 0}, load,
                           k_t, a, radius, root, &p->roll[s]);
        int to = j >= start && j < end ? j : nowhere;
        f[i].x += fx, f[i].y += fy, f[i].z += fz;
        t[i].x += arm_i * qx + turn.x, t[i].y += arm_i * qy + turn.y, t[i].z += arm_i * qz + turn.z;
        f[to].x -= fx, f[to].y -= fy, f[to].z -= fz;
        t[to].x += arm_j * qx - turn.x, t[to].y += arm_j * qy - turn.y, t[to].z += arm_j * qz - turn.z;
        s++;
    }
}

#include "yardstick_blocks.h"

static void push_floor(part *p, double dt) {
    for (int s = 0; s < p->near_count; s++) {
        int i = p->near[s];
        double overlap = X[i].w - X[i].z;
        if (!(overlap > 0.0)) {
            p->near_slide[s] = p->near_roll[s] = (quad){0, 0, 0, 0};
            continue;
        }
        double arm = X[i].w - overlap, vn = V[i].z, back = arm - 0.5 * dt * vn;
        double tx = V[i].x - back * W[i].y, ty = V[i].y + back * W[i].x;
        double fx, fy, fz, load, k_t, a, root;
        contact(&ground, dt, 0, 0, 1, vn, tx, ty, 0, overlap, X[i].w, V[i].w, &p->near_slide[s], &fx, &fy, &fz, &load,
                &k_t, &a, &root);
        F[i].x += fx, F[i].y += fy, F[i].z += fz;
        T[i].x += arm * fy, T[i].y -= arm * fx;
        if (with_rolling) {
            quad turn = turning(&ground, dt, 0, 0, 1, W[i], load, k_t, a, X[i].w, root, &p->near_roll[s]);
            T[i].x += turn.x, T[i].y += turn.y, T[i].z += turn.z;
        }
    }
}

/* The time since `*last`, which becomes now, is of this phase. */
static void spend(part *p, int phase, double *last) {
    double now = omp_get_wtime();
    p->spent[phase] += now - *last;
    *last = now;
}

static void push(part *p, int me, double dt, double far, double *last) {
    sieve(p, far);
    spend(p, FINDING, last);
    if (in_blocks && with_rolling)
        push_blocks(p, me, dt, 1);
    else if (in_blocks)
        push_blocks(p, me, dt, 0);
    else if (with_rolling)
        push_pairs(p, me, dt, 1);
    else
        push_pairs(p, me, dt, 0);
    push_floor(p, dt);
    spend(p, FORCES, last);
}

static void move(part *p, double dt) {
    double far = 0.0;
    for (int i = p->start; i < p->end; i++) {
        double by = dt / V[i].w, turn = 2.5 * by / (X[i].w * X[i].w);
        V[i].x += by * F[i].x, V[i].y += by * F[i].y, V[i].z += by * F[i].z;
        W[i].x += turn * T[i].x, W[i].y += turn * T[i].y, W[i].z += turn * T[i].z;
        X[i].x += dt * V[i].x, X[i].y += dt * V[i].y, X[i].z += dt * V[i].z;
        double x = X[i].x - X0[i].x, y = X[i].y - X0[i].y, z = X[i].z - X0[i].z;
        double square = x * x + y * y + z * z;
        far = square > far ? square : far;
        double m = V[i].w;
        F[i] = (quad){m * G[0], m * G[1], m * G[2], 0};
        T[i] = (quad){0, 0, 0, 0};
    }
    p->far = far;
}

static double farthest(void) {
    double far = 0.0;
    for (int k = 0; k < threads; k++) far = fmax(far, parts[k].far);
    return sqrt(far);
}

static int between(int k, int n) { return k < 0 ? 0 : k >= n ? n - 1 : k; }

/* Cells in columns along z, the columns in strips, so that neighbours are near in memory. */
static void lay_cells(void) {
    double largest = 0.0, top = -1e30;
    bottom = 1e30;
    for (int i = 0; i < N; i++) {
        largest = fmax(largest, X[i].w), top = fmax(top, X[i].z), bottom = fmin(bottom, X[i].z);
    }
    double least = 2.0 * largest + skin;
    int had = nx * ny * nz;
    nx = (int)(PX / least), ny = (int)(PY / least), nz = (int)((top - bottom) / least) + 1;
    size_x = PX / nx, size_y = PY / ny, size_z = least;
    if (nx < 3 || ny < 3) exit(4);
    if (nx * ny * nz > had) {
        free(cell_start), free(column);
        cell_start = room((nx * ny * nz + 2) * sizeof(int));
        column = room(nx * ny * sizeof(int));
    }
    int rank = 0;
    const int strip = 8;
    for (int j0 = 0; j0 < ny; j0 += strip)
        for (int i = 0; i < nx; i++)
            for (int j = j0; j < j0 + strip && j < ny; j++) column[j * nx + i] = rank++;
}

static void permute(quad *a, const int *from) {
    for (int k = 0; k < N; k++) buffer[k] = a[from[k]];
    memcpy(a, buffer, N * sizeof(quad));
}

/* Sort the grains; chain the old contacts by the smaller of their new numbers. */
static pair *old_rows;
static quad *old_slide, *old_roll;
static int old_room;
static int *near_old;
static quad *near_old_slide, *near_old_roll;

static void sort_grains(void) {
    int total = 0;
    for (int k = 0; k < threads; k++) total += parts[k].count;
    if (total > old_room) {
        old_room = total * 3 / 2;
        free(old_rows), free(old_slide), free(old_roll), free(next_old);
        old_rows = room(old_room * sizeof(pair)), old_slide = room(old_room * sizeof(quad));
        old_roll = room(old_room * sizeof(quad)), next_old = room(old_room * sizeof(int));
    }
    lay_cells();
    int cells = nx * ny * nz;
    memset(cell_start, 0, (cells + 2) * sizeof(int));
    for (int i = 0; i < N; i++) {
        X[i].x -= PX * floor(X[i].x / PX), X[i].y -= PY * floor(X[i].y / PY);
        int a = between((int)(X[i].x / size_x), nx), b = between((int)(X[i].y / size_y), ny);
        cell[i] = column[b * nx + a] * nz + between((int)((X[i].z - bottom) / size_z), nz);
        cell_start[cell[i] + 2]++;
    }
    for (int c = 0; c <= cells; c++) cell_start[c + 1] += cell_start[c];
    int *from = spare, *place = head;
    for (int i = 0; i < N; i++) from[place[i] = cell_start[cell[i] + 1]++] = i;
    permute(X, from), permute(V, from), permute(W, from), permute(F, from), permute(T, from);
    memcpy(X0, X, N * sizeof(quad));
    int *kept = (int *)buffer;
    for (int k = 0; k < N; k++) kept[k] = id[from[k]];
    memcpy(id, kept, N * sizeof(int));
    for (int k = 0; k < N; k++) near_old[k] = -1;
    int rows = 0, flats = 0;
    for (int q = 0; q < threads; q++) {
        part *p = &parts[q];
        for (int s = 0; s < p->near_count; s++) {
            near_old_slide[flats] = p->near_slide[s], near_old_roll[flats] = p->near_roll[s];
            near_old[place[p->near[s]]] = flats++;
        }
        for (int s = 0; s < p->count; s++) {
            int i = place[p->touch[s].i], j = place[p->touch[s].j & MASK];
            old_rows[rows] = (pair){i, j};
            old_slide[rows] = p->slide[s], old_roll[rows++] = p->roll[s];
        }
    }
    for (int k = 0; k < N; k++) head[k] = -1;
    for (int s = rows - 1; s >= 0; s--) {
        int least = old_rows[s].i < old_rows[s].j ? old_rows[s].i : old_rows[s].j;
        next_old[s] = head[least], head[least] = s;
    }
    for (int k = 0; k < threads; k++) {
        parts[k].start = (long)N * k / threads, parts[k].end = (long)N * (k + 1) / threads;
    }
}

static void list_pair(part *p, int i, int bits, double square, double sum) {
    int j = bits & MASK;
    quad none = {0, 0, 0, 0};
    if (!(square < sum * sum)) {
        to_box(&p->apart[between((int)((sqrt(square) - sum) / skin * BOXES), BOXES)], (pair){i, bits});
        return;
    }
    for (int s = head[i < j ? i : j]; s >= 0; s = next_old[s]) {
        int same = old_rows[s].i == i && old_rows[s].j == j, turned_round = old_rows[s].i == j && old_rows[s].j == i;
        if (same || turned_round) {
            double sign = same ? 1.0 : -1.0;
            quad u = old_slide[s], q = old_roll[s];
            to_touch(p, (pair){i, bits}, (quad){sign * u.x, sign * u.y, sign * u.z, u.w},
                     (quad){sign * q.x, sign * q.y, sign * q.z, 0});
            return;
        }
    }
    to_touch(p, (pair){i, bits}, none, none);
}

static void list_pairs(part *p) {
    p->count = p->near_count = 0;
    for (int k = 0; k < BOXES; k++) p->apart[k].count = 0;
    for (int i = p->start; i < p->end; i++) {
        quad x = X[i];
        int a = between((int)(x.x / size_x), nx), b = between((int)(x.y / size_y), ny);
        int c = between((int)((x.z - bottom) / size_z), nz), low = c ? c - 1 : 0, high = c + 2 < nz ? c + 2 : nz;
        for (int db = -1; db < 2; db++)
            for (int da = -1; da < 2; da++) {
                int ga = a + da, gb = b + db;
                int ma = (ga < 0) - (ga >= nx), mb = (gb < 0) - (gb >= ny);
                int base = column[(gb + mb * ny) * nx + ga + ma * nx] * nz, image = ma + 1 + 3 * (mb + 1);
                double sx = shift[image][0], sy = shift[image][1];
                for (int j = cell_start[base + low]; j < cell_start[base + high]; j++) {
                    if (j <= i && (j == i || j >= p->start)) continue;
                    double dx = x.x - X[j].x + sx, dy = x.y - X[j].y + sy, dz = x.z - X[j].z, sum = x.w + X[j].w;
                    double square = dx * dx + dy * dy + dz * dz;
                    if (square < (sum + skin) * (sum + skin)) list_pair(p, i, j | image << BITS, square, sum);
                }
            }
        if (x.z < x.w + skin) {
            int s = p->near_count++, o = near_old[i];
            p->near[s] = i;
            p->near_slide[s] = o < 0 ? (quad){0, 0, 0, 0} : near_old_slide[o];
            p->near_roll[s] = o < 0 ? (quad){0, 0, 0, 0} : near_old_roll[o];
        }
    }
}

static int advance(int steps) {
    int lists = 0;
#pragma omp parallel num_threads(threads)
    {
        int me = omp_get_thread_num();
        part *p = &parts[me];
        double last = omp_get_wtime();
        for (int k = 0; k < steps; k++) {
            move(p, DT);
            spend(p, MOVING, &last);
            meet();
            double far = farthest();
            spend(p, WAITING, &last);
            if (2.0 * far > skin) {
                meet();
                spend(p, WAITING, &last);
                if (me == 0) {
                    sort_grains(), lists++;
                    spend(p, SORTING, &last);
                }
                meet();
                spend(p, WAITING, &last);
                list_pairs(p);
                spend(p, LISTING, &last);
                far = 0.0;
            }
            push(p, me, DT, far, &last);
            meet();
            spend(p, WAITING, &last);
        }
    }
    return lists;
}

static double next(FILE *f) {
    double value;
    if (fread(&value, sizeof value, 1, f) != 1) exit(5);
    return value;
}

static law read_law(FILE *f) {
    double v[8];
    for (int k = 0; k < 8; k++) v[k] = next(f);
    return (law){v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7]};
}

int main(int words, char **word) {
    if (words != 9) return 2;
    FILE *f = fopen(word[1], "rb");
    if (!f) return 5;
    threads = atoi(word[3]);
    int warm = atoi(word[4]), steps = atoi(word[5]);
    skin = atof(word[6]), with_rolling = atoi(word[7]), in_blocks = atoi(word[8]);
    N = (int)next(f), PX = next(f), PY = next(f), DT = next(f);
    for (int k = 0; k < 3; k++) G[k] = next(f);
    grain = read_law(f), ground = read_law(f);
    if (threads < 1 || threads > MOST_THREADS || N > MASK) return 2;
    quad **all[] = {&X, &V, &W, &F, &T, &X0, &buffer, &near_old_slide, &near_old_roll};
    for (int k = 0; k < 9; k++) *all[k] = room((N + MOST_THREADS) * sizeof(quad));
    int **more_of[] = {&id, &spare, &cell, &head, &near_old};
    for (int k = 0; k < 5; k++) *more_of[k] = room(N * sizeof(int));
    for (int i = 0; i < N; i++) {
        double x = next(f), y = next(f), z = next(f), r = next(f), m = next(f);
        X[i] = (quad){x, y, z, r}, V[i].w = m, id[i] = i;
        F[i] = (quad){m * G[0], m * G[1], m * G[2], 0};
    }
    fclose(f);
    for (int k = 0; k < 9; k++) shift[k][0] = (k % 3 - 1) * PX, shift[k][1] = (k / 3 - 1) * PY;
    for (int k = 0; k < threads; k++) {
        int share = N / threads + 1;
        parts[k].near = room(share * sizeof(int));
        parts[k].near_slide = room(share * sizeof(quad)), parts[k].near_roll = room(share * sizeof(quad));
    }
    sort_grains();
    double began = omp_get_wtime();
    for (int k = 0; k < threads; k++) list_pairs(&parts[k]), push(&parts[k], k, 0.0, 0.0, &began);
    for (int i = 0; i < N; i++) { /* velocities live half a step behind positions */
        double by = -0.5 * DT / V[i].w, turn = 2.5 * by / (X[i].w * X[i].w);
        V[i].x = by * F[i].x, V[i].y = by * F[i].y, V[i].z = by * F[i].z;
        W[i].x = turn * T[i].x, W[i].y = turn * T[i].y, W[i].z = turn * T[i].z;
    }
    advance(warm);
    for (int k = 0; k < threads; k++) parts[k].checked = 0, memset(parts[k].spent, 0, sizeof parts[k].spent);
    began = omp_get_wtime();
    int lists = advance(steps);
    double took = omp_get_wtime() - began, energy = 0.0;
    long touching = 0, rows = 0, checked = 0;
    for (int k = 0; k < threads; k++) {
        touching += parts[k].count, checked += parts[k].checked;
        for (int b = 0; b < BOXES; b++) rows += parts[k].apart[b].count;
    }
    double *out = room(3 * N * sizeof(double));
    for (int i = 0; i < N; i++) {
        double by = 0.5 * DT / V[i].w, turn = 2.5 * by / (X[i].w * X[i].w);
        double v[] = {V[i].x + by * F[i].x, V[i].y + by * F[i].y, V[i].z + by * F[i].z};
        double w[] = {W[i].x + turn * T[i].x, W[i].y + turn * T[i].y, W[i].z + turn * T[i].z};
        for (int k = 0; k < 3; k++)
            energy += V[i].w * (0.5 * v[k] * v[k] + 0.2 * X[i].w * X[i].w * w[k] * w[k]);
        out[3 * id[i]] = X[i].x, out[3 * id[i] + 1] = X[i].y, out[3 * id[i] + 2] = X[i].z;
    }
    f = fopen(word[2], "wb");
    if (!f || fwrite(out, sizeof(double), 3 * N, f) != (size_t)(3 * N) || fclose(f)) return 5;
    printf("%.9g %d %.9g %ld %ld %.9g", took, lists, energy, touching, rows, (double)checked / (steps ? steps : 1));
    for (int phase = 0; phase < PHASES; phase++) {
        double spent = 0.0;
        for (int k = 0; k < threads; k++) spent += parts[k].spent[phase];
        printf(" %.9g", spent);
    }
    printf("\n");
    return 0;
}

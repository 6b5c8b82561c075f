/* Touching pairs in blocks: what they need is gathered into arrays, computed without a branch, and added up one by one.
   GCC and clang make vector instructions of the middle part only where a division may be computed for a pair that does
   not need it: -fno-trapping-math. Included by yardstick.c. */

#define BLOCK 64
typedef double four __attribute__((vector_size(32)));
typedef double eight __attribute__((vector_size(64)));
typedef double lanes[BLOCK] __attribute__((aligned(64)));

typedef struct {
    lanes dx, dy, dz, ri, rj, mi, mj, vx, vy, vz, wx, wy, wz, ux, uy, uz; /* w: spin of the first, u: of the other */
    lanes sx, sy, sz, past, qx, qy, qz; /* history: slide, what the dashpot remembers, roll */
    lanes nx, ny, nz, vn, overlap, radius, mass, by_length, damping, open, fresh;
    lanes fx, fy, fz, tx, ty, tz, ox, oy, oz; /* force and torque on the first, torque on the other */
} block;

/* Eight rows of four to four rows of eight. */
INLINE void turned(const four *r, double *x, double *y, double *z, double *w) {
    eight a = __builtin_shufflevector(r[0], r[2], 0, 1, 2, 3, 4, 5, 6, 7);
    eight b = __builtin_shufflevector(r[1], r[3], 0, 1, 2, 3, 4, 5, 6, 7);
    eight c = __builtin_shufflevector(r[4], r[6], 0, 1, 2, 3, 4, 5, 6, 7);
    eight d = __builtin_shufflevector(r[5], r[7], 0, 1, 2, 3, 4, 5, 6, 7);
    eight even = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
    eight odd = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
    eight more_even = __builtin_shufflevector(c, d, 0, 8, 2, 10, 4, 12, 6, 14);
    eight more_odd = __builtin_shufflevector(c, d, 1, 9, 3, 11, 5, 13, 7, 15);
    *(eight *)x = __builtin_shufflevector(even, more_even, 0, 1, 4, 5, 8, 9, 12, 13);
    *(eight *)z = __builtin_shufflevector(even, more_even, 2, 3, 6, 7, 10, 11, 14, 15);
    *(eight *)y = __builtin_shufflevector(odd, more_odd, 0, 1, 4, 5, 8, 9, 12, 13);
    if (w) *(eight *)w = __builtin_shufflevector(odd, more_odd, 2, 3, 6, 7, 10, 11, 14, 15);
}

INLINE void gather(block *b, const part *p, int first, int n, const int rolling) {
    const four *x = (const four *)X, *v = (const four *)V, *w = (const four *)W;
    const four *slide = (const four *)p->slide + first, *roll = (const four *)p->roll + first;
    const pair *rows = p->touch + first;
    for (int k = 0; k < n; k += WIDE) {
        four apart[WIDE], rate[WIDE], own[WIDE], other[WIDE];
        for (int m = 0; m < WIDE; m++) {
            int i = rows[k + m].i, bits = rows[k + m].j, j = bits & MASK;
            apart[m] = x[i] - x[j] + *(const four *)shift[bits >> BITS], rate[m] = v[i] - v[j];
            own[m] = w[i], other[m] = w[j];
            b->ri[k + m] = x[i][3], b->rj[k + m] = x[j][3], b->mi[k + m] = v[i][3], b->mj[k + m] = v[j][3];
        }
        turned(apart, b->dx + k, b->dy + k, b->dz + k, 0);
        turned(rate, b->vx + k, b->vy + k, b->vz + k, 0);
        turned(own, b->wx + k, b->wy + k, b->wz + k, 0);
        turned(other, b->ux + k, b->uy + k, b->uz + k, 0);
        turned(slide + k, b->sx + k, b->sy + k, b->sz + k, b->past + k);
        if (rolling) turned(roll + k, b->qx + k, b->qy + k, b->qz + k, 0);
    }
}

/* Normals and rates; how many pairs have opened, and how many have come to touch. */
INLINE void measure(block *b, int n, double damping, int *opened, int *came) {
    double open = 0.0, fresh = 0.0;
#pragma omp simd reduction(+ : open, fresh)
    for (int k = 0; k < n; k++) {
        double dx = b->dx[k], dy = b->dy[k], dz = b->dz[k], ri = b->ri[k], rj = b->rj[k], mi = b->mi[k], mj = b->mj[k];
        double sum = ri + rj, square = dx * dx + dy * dy + dz * dz, both = mi + mj, length = sqrt(square);
        double inverse = 1.0 / (length * sum * both), by_length = sum * both * inverse;
        double nx = dx * by_length, ny = dy * by_length, nz = dz * by_length;
        b->open[k] = square < sum * sum ? 0.0 : 1.0, b->fresh[k] = b->past[k] == 0.0 ? 1.0 : 0.0;
        open += b->open[k], fresh += b->fresh[k];
        b->overlap[k] = square < sum * sum ? sum - length : 0.0;
        b->nx[k] = nx, b->ny[k] = ny, b->nz[k] = nz, b->by_length[k] = by_length;
        b->vn[k] = b->vx[k] * nx + b->vy[k] * ny + b->vz[k] * nz;
        b->radius[k] = ri * rj * (length * both * inverse), b->mass[k] = mi * mj * (length * sum * inverse);
        b->damping[k] = damping;
    }
    *opened = (int)open, *came = (int)fresh;
}

/* Forces and torques; an open pair has none, as its overlap is 0. */
INLINE void compute(block *b, int n, double dt, law p, const int rolling) {
#pragma omp simd
    for (int k = 0; k < n; k++) {
        double nx = b->nx[k], ny = b->ny[k], nz = b->nz[k], vn = b->vn[k], overlap = b->overlap[k], mass = b->mass[k];
        double arm_i = b->ri[k] - 0.5 * overlap, arm_j = b->rj[k] - 0.5 * overlap, radius = b->radius[k];
        double h = 0.5 * dt * b->by_length[k], back = 0.25 * dt * vn, bi = arm_i - back, bj = arm_j - back;
        double ax = bi * b->wx[k] + bj * b->ux[k], ay = bi * b->wy[k] + bj * b->uy[k];
        double az = bi * b->wz[k] + bj * b->uz[k];
        double grow = 1.0 + h * vn;
        double tx = grow * (b->vx[k] - vn * nx) - (ay * nz - az * ny);
        double ty = grow * (b->vy[k] - vn * ny) - (az * nx - ax * nz);
        double tz = grow * (b->vz[k] - vn * nz) - (ax * ny - ay * nx);
        double a = sqrt(radius * overlap), s_n = p.two_e * a, root = sqrt(mass * s_n);
        double spring = (2.0 / 3.0) * s_n * overlap, c_n = b->damping[k] * root, momentum = mass * vn;
        double past = b->fresh[k] != 0.0 ? 0.5 * momentum : b->past[k];
        double load = (mass * spring - c_n * (1.5 * momentum - past)) / (mass + 0.5 * dt * c_n);
        double kt = p.eight_g * a, c = p.tangential * root;
        double sx = b->sx[k] + dt * tx, sy = b->sy[k] + dt * ty, sz = b->sz[k] + dt * tz;
        double along = sx * nx + sy * ny + sz * nz;
        sx -= along * nx, sy -= along * ny, sz -= along * nz;
        double bound = p.friction * fabs(load), most = bound * bound, held = kt * kt * (sx * sx + sy * sy + sz * sz);
        c = held > most ? 0.0 : c;
        double gx = -kt * sx - c * tx, gy = -kt * sy - c * ty, gz = -kt * sz - c * tz;
        double square = gx * gx + gy * gy + gz * gz, share = bound / sqrt(square);
        share = square > most ? share : 1.0;
        gx *= share, gy *= share, gz *= share;
        double left = held > most ? share : 1.0;
        b->sx[k] = left * sx, b->sy[k] = left * sy, b->sz[k] = left * sz, b->past[k] = 0.5 * (momentum + dt * load);
        double fx = load * nx + gx, fy = load * ny + gy, fz = load * nz + gz;
        double qx = fy * nz - fz * ny, qy = fz * nx - fx * nz, qz = fx * ny - fy * nx, mx = 0.0, my = 0.0, mz = 0.0;
        if (rolling) {
            double spin_x = b->wx[k] - b->ux[k], spin_y = b->wy[k] - b->uy[k], spin_z = b->wz[k] - b->uz[k];
            double rx = b->qx[k] + spin_x * dt, ry = b->qy[k] + spin_y * dt, rz = b->qz[k] + spin_z * dt;
            double spin_n = spin_x * nx + spin_y * ny + spin_z * nz, twist = rx * nx + ry * ny + rz * nz;
            rx -= twist * nx, ry -= twist * ny, rz -= twist * nz;
            double force = fabs(load), kr = kt * radius * radius, cr = p.turning * root * radius * radius;
            double limit = p.rolling * radius * force, top = limit * limit;
            double bent = kr * kr * (rx * rx + ry * ry + rz * rz);
            cr = bent > top ? 0.0 : cr;
            mx = -kr * rx - cr * (spin_x - spin_n * nx), my = -kr * ry - cr * (spin_y - spin_n * ny);
            mz = -kr * rz - cr * (spin_z - spin_n * nz);
            double torque = mx * mx + my * my + mz * mz, part_of = limit / sqrt(torque);
            part_of = torque > top ? part_of : 1.0;
            double stays = bent > top ? part_of : 1.0;
            double kw = 0.5 * kt * a * a, cw = 0.7071067811865476 * p.turning * root * radius * a;
            double end = 0.1875 * M_PI * p.friction * a * force, m = -kw * twist;
            double cut = m > end ? end : m < -end ? -end : m, kept = -cut / kw;
            double damped = m - cw * spin_n;
            damped = damped > end ? end : damped < -end ? -end : damped;
            twist = cut != m ? kept : twist, m = cut != m ? cut : damped;
            mx = part_of * mx + m * nx, my = part_of * my + m * ny, mz = part_of * mz + m * nz;
            b->qx[k] = stays * rx + twist * nx, b->qy[k] = stays * ry + twist * ny, b->qz[k] = stays * rz + twist * nz;
        }
        b->fx[k] = fx, b->fy[k] = fy, b->fz[k] = fz;
        b->tx[k] = arm_i * qx + mx, b->ty[k] = arm_i * qy + my, b->tz[k] = arm_i * qz + mz;
        b->ox[k] = arm_j * qx - mx, b->oy[k] = arm_j * qy - my, b->oz[k] = arm_j * qz - mz;
    }
}

INLINE void scatter(part *p, int me, const block *b, int first, int n, double dt, const int rolling) {
    const pair *rows = p->touch + first;
    four *f = (four *)F, *t = (four *)T, *slide = (four *)p->slide + first, *roll = (four *)p->roll + first;
    for (int k = 0; k < n; k++) {
        int i = rows[k].i, j = rows[k].j & MASK, to = j >= p->start && j < p->end ? j : N + me;
        four force = {b->fx[k], b->fy[k], b->fz[k], 0.0};
        f[i] += force, t[i] += (four){b->tx[k], b->ty[k], b->tz[k], 0.0};
        f[to] -= force, t[to] += (four){b->ox[k], b->oy[k], b->oz[k], 0.0};
        if (dt > 0.0) {
            slide[k] = (four){b->sx[k], b->sy[k], b->sz[k], b->past[k]};
            if (rolling) roll[k] = (four){b->qx[k], b->qy[k], b->qz[k], 0.0};
        }
    }
}

INLINE void push_blocks(part *p, int me, double dt, const int rolling) {
    static __thread block b;
    for (int s = 0; s < p->count;) {
        int n = p->count - s < BLOCK ? p->count - s : BLOCK, opened, came;
        /* The last vector is filled up with the block's first pair, and what comes of it is dropped. */
        for (int k = n; k % WIDE; k++) keep_row(p, s + k, s);
        gather(&b, p, s, n, rolling);
        measure(&b, n, grain.damping, &opened, &came);
        for (int k = 0; k < n && came; k++)
            if (b.fresh[k] != 0.0 && b.overlap[k] < -1.001 * b.vn[k] * dt)
                b.damping[k] *= first_touch(b.overlap[k] / (-b.vn[k] * dt));
        compute(&b, n, dt, grain, rolling);
        for (int k = 0; k < n && opened; k++)
            if (b.open[k] != 0.0) {
                b.fx[k] = b.fy[k] = b.fz[k] = b.tx[k] = b.ty[k] = b.tz[k] = b.ox[k] = b.oy[k] = b.oz[k] = 0.0;
            }
        scatter(p, me, &b, s, n, dt, rolling);
        int end = s + n;
        for (int k = n - 1; k >= 0 && opened; k--)
            if (b.open[k] != 0.0) { /* the last of the block takes its place, and the last of all that one's */
                to_box(&p->apart[0], p->touch[s + k]);
                keep_row(p, s + k, --end), keep_row(p, end, --p->count);
            }
        s = end;
    }
}

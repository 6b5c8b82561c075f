/* The contact law of dem.contact.law, pair by pair. Included by yardstick.c. */

static double first_touch(double share) {
    double f = share > 1e-6 ? share : 1e-6;
    return 0.8 * (f + 0.5) * sqrt(sqrt((f + 0.5) / f));
}

/* The force on the first of a pair, as dem.contact.law has it, with damping that may pull. (nx, ny, nz) towards the
   first, v its rate against the other and (wx, wy, wz) the spins times their arms, half a step ago. */
INLINE void contact(
    const law *p, double dt, double nx, double ny, double nz, double vn, double tx, double ty, double tz,
    double overlap, double radius, double mass, quad *u, double *fx, double *fy, double *fz, double *f_n,
    double *k_t, double *a_out, double *root_out)
{
    double a = sqrt(radius * overlap);
    double s_n = p->two_e * a, root = sqrt(mass * s_n);
    double spring = (2.0 / 3.0) * s_n * overlap;
    double c_n = p->damping * root, momentum = mass * vn, past = u->w;
    if (past == 0.0 || dt == 0.0) {
        past = 0.5 * momentum;
        if (overlap < -1.001 * vn * dt && u->w == 0.0) {
            c_n *= first_touch(overlap / (-vn * dt));
        }
    }
    double n = (mass * spring - c_n * (1.5 * momentum - past)) / (mass + 0.5 * dt * c_n);
    double k = p->eight_g * a, c = p->tangential * root;
    double sx = u->x + dt * tx, sy = u->y + dt * ty, sz = u->z + dt * tz;
    double along = sx * nx + sy * ny + sz * nz;
    sx -= along * nx, sy -= along * ny, sz -= along * nz;
    double gx = -k * sx, gy = -k * sy, gz = -k * sz, bound = p->friction * fabs(n);
    double square = gx * gx + gy * gy + gz * gz;
    if (square > bound * bound) {
        double share = bound / sqrt(square);
        gx *= share, gy *= share, gz *= share, sx *= share, sy *= share, sz *= share;
    } else {
        gx -= c * tx, gy -= c * ty, gz -= c * tz;
        square = gx * gx + gy * gy + gz * gz;
        if (square > bound * bound) {
            double share = bound / sqrt(square);
            gx *= share, gy *= share, gz *= share;
        }
    }
    if (dt > 0.0) *u = (quad){sx, sy, sz, 0.5 * (momentum + dt * n)};
    *fx = n * nx + gx, *fy = n * ny + gy, *fz = n * nz + gz;
    *f_n = n, *k_t = k, *a_out = a, *root_out = root;
}

/* The torque of rolling and twisting on the first of a pair; s: its spin against the other's. */
INLINE quad turning(
    const law *p, double dt, double nx, double ny, double nz, quad s, double load, double k_t, double a, double radius,
    double root, quad *q)
{
    double x = q->x + s.x * dt, y = q->y + s.y * dt, z = q->z + s.z * dt;
    double s_n = s.x * nx + s.y * ny + s.z * nz, twist = x * nx + y * ny + z * nz, force = fabs(load);
    x -= twist * nx, y -= twist * ny, z -= twist * nz;
    double k = k_t * radius * radius, c = p->turning * root * radius * radius, bound = p->rolling * radius * force;
    double mx = -k * x, my = -k * y, mz = -k * z, square = mx * mx + my * my + mz * mz;
    if (square > bound * bound) {
        double share = bound / sqrt(square);
        mx *= share, my *= share, mz *= share, x *= share, y *= share, z *= share;
    } else {
        mx -= c * (s.x - s_n * nx), my -= c * (s.y - s_n * ny), mz -= c * (s.z - s_n * nz);
        square = mx * mx + my * my + mz * mz;
        if (square > bound * bound) {
            double share = bound / sqrt(square);
            mx *= share, my *= share, mz *= share;
        }
    }
    double kw = 0.5 * k_t * a * a, cw = 0.7071067811865476 * p->turning * root * radius * a;
    double most = 0.1875 * M_PI * p->friction * a * force, m = -kw * twist;
    if (fabs(m) > most) {
        m = m > 0.0 ? most : -most;
        twist = -m / kw;
    } else
        m = fmin(most, fmax(-most, m - cw * s_n));
    if (dt > 0.0) *q = (quad){x + twist * nx, y + twist * ny, z + twist * nz, 0.0};
    return (quad){mx + m * nx, my + m * ny, mz + m * nz, 0.0};
}

/* One interval between two samples: classical Runge-Kutta steps, inputs linear, set-points held.
   Made by awes; awescli/simulation/stepping.py says why. */

void MODEL_hold(double *x, const double *u, const double *sp, const double *c)
{
    int i;
    for (i = 0; i < MODEL_SET_POINTS; i++)
        x[MODEL_STATES + i] = sp[i];
MODEL_LAW
}

static void between(double *to, const double *a, const double *b, double share, int n)
{
    int i;
    for (i = 0; i < n; i++)
        to[i] = a[i] + share * (b[i] - a[i]);
}

void MODEL_step(double *x, const double *u, const double *u_next, const double *sp, const double *sp_next,
                const double *c, double dt)
{
    double v[MODEL_INPUTS + 1], held[MODEL_SET_POINTS], stage[MODEL_STATES + MODEL_SET_POINTS];
    double k[MODEL_STATES], total[MODEL_STATES];
    const double whole = ceil(dt / MODEL_LONGEST_STEP - 1e-9);
    const int substeps = whole > 1.0 ? (int)whole : 1;
    const double step = dt / substeps, half = step / 2.0, sixth = step / 6.0;
    /* a sample that is as fast as the flight controller holds every set-point; in a slower one they are taken on the
       line between samples, half a period of the controller late */
    const int fast = MODEL_SET_POINT_RATE * dt <= 1.001;
    const double first = fast ? 0.0 : (step - 1.0 / MODEL_SET_POINT_RATE) / 2.0 / dt, onward = fast ? 0.0 : step / dt;
    int sub, i;

    MODEL_hold(x, u, sp, c);
    for (sub = 0; sub < substeps; sub++) {
        const double along = first + onward * sub;
        between(v, u, u_next, (double)sub / substeps, MODEL_INPUTS);
        if (along != 0.0) {
            between(held, sp, sp_next, along, MODEL_SET_POINTS);
            MODEL_hold(x, v, held, c);
        }
        for (i = 0; i < MODEL_SET_POINTS; i++)
            stage[MODEL_STATES + i] = x[MODEL_STATES + i];
        MODEL_derivative(x, v, c, total);
        for (i = 0; i < MODEL_STATES; i++)
            stage[i] = x[i] + half * total[i];
        between(v, u, u_next, (sub + 0.5) / substeps, MODEL_INPUTS);
        MODEL_derivative(stage, v, c, k);
        for (i = 0; i < MODEL_STATES; i++) {
            stage[i] = x[i] + half * k[i];
            total[i] = total[i] + 2.0 * k[i];
        }
        MODEL_derivative(stage, v, c, k);
        for (i = 0; i < MODEL_STATES; i++) {
            stage[i] = x[i] + step * k[i];
            total[i] = total[i] + 2.0 * k[i];
        }
        between(v, u, u_next, (sub + 1.0) / substeps, MODEL_INPUTS);
        MODEL_derivative(stage, v, c, k);
        for (i = 0; i < MODEL_STATES; i++)
            x[i] = x[i] + sixth * (total[i] + k[i]);
    }
}

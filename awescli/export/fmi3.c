/* FMI 3.0 around a model: Co-Simulation and Model Exchange. Made by awes.

   Types and signatures are those of the FMI 3.0 standard (fmi-standard.org). All variables are Float64; value references:
   0 time, then STATES states, SET_POINTS held set-points (of no variable), SET_POINTS set-points, INPUTS inputs, INPUTS slopes of
   the inputs, PARAMETERS parameters, STATES derivatives, OUTPUTS outputs. fmu.h names the model.

   Co-Simulation: a step goes from sample to sample as NAME_step does; inputs run on their slopes, set-points are held, a flight
   controller is asked at every communication point. Model Exchange: a flight controller is asked at time events. */
#include "fmi3.h"

static void reset(Instance *m)
{
    int i;
    memset(m->v, 0, sizeof m->v);
    for (i = 0; i < 12; i++)
        m->v[X + i] = MODEL_start_states[i];
    for (i = 0; i < SET_POINTS; i++)
        m->v[SP + i] = MODEL_start_set_points[i];
    for (i = 0; i < INPUTS; i++)
        m->v[U + i] = MODEL_start_inputs[i];
    for (i = 0; i < PARAMETERS; i++)
        m->v[C + i] = MODEL_parameters[i];
    m->phase = INSTANTIATED;
    m->fresh = false;
    m->next_event = 0.0;
}

static void hold(Instance *m)
{
    MODEL_hold(m->v + X, m->v + U, m->v + SP, m->v + C);
}

/* Derivatives and outputs of the state, the inputs and the set-points as they are now. */
static void refresh(Instance *m)
{
    if (m->fresh)
        return;
    if (m->phase != RUNNING) {
        hold(m);
        MODEL_initial(m->v + X, m->v + U, m->v + C);
    } else if (!(m->exchange && HAS_LAW)) {
        hold(m);
    }
    MODEL_derivative(m->v + X, m->v + U, m->v + C, m->v + DX);
    MODEL_outputs(m->v + X, m->v + U, m->v + C, m->v + Y);
    m->fresh = true;
}

static bool finite_states(const Instance *m)
{
    int i;
    for (i = 0; i < STATES; i++)
        if (!(fabs(m->v[X + i]) < 1e6))
            return false;
    return true;
}

/* common functions */

FMI3_Export const char *FMI(fmi3GetVersion)(void)
{
    return "3.0";
}

FMI3_Export fmi3Status FMI(fmi3SetDebugLogging)(fmi3Instance instance, bool on, size_t n, const char *const categories[])
{
    (void)instance, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

static fmi3Instance made(const char *token, bool exchange, void *environment, LogMessage log)
{
    Instance *m;
    if (!token || strcmp(token, TOKEN)) {
        if (log)
            log(environment, fmi3Error, "logStatusError", "the instantiation token is not that of this model");
        return NULL;
    }
    m = (Instance *)calloc(1, sizeof *m);
    if (!m)
        return NULL;
    m->exchange = exchange;
    m->environment = environment;
    m->log = log;
    reset(m);
    return m;
}

FMI3_Export fmi3Instance FMI(fmi3InstantiateModelExchange)(const char *name, const char *token, const char *resources, bool visible,
                                                           bool logging, void *environment, LogMessage log)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    return made(token, true, environment, log);
}

FMI3_Export fmi3Instance FMI(fmi3InstantiateCoSimulation)(const char *name, const char *token, const char *resources, bool visible,
                                                          bool logging, bool events, bool early, const Reference required[],
                                                          size_t n, void *environment, LogMessage log, void *update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)n, (void)update;
    return made(token, false, environment, log);
}

FMI3_Export fmi3Instance FMI(fmi3InstantiateScheduledExecution)(const char *name, const char *token, const char *resources, bool visible,
                                                                bool logging, void *environment, LogMessage log, void *clock,
                                                                void *lock, void *unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock, (void)lock, (void)unlock;
    if (log)
        log(environment, fmi3Error, "logStatusError", "Scheduled Execution is not supported");
    return NULL;
}

FMI3_Export void FMI(fmi3FreeInstance)(fmi3Instance instance)
{
    free(instance);
}

FMI3_Export fmi3Status FMI(fmi3EnterInitializationMode)(fmi3Instance instance, bool tolerance_defined, double tolerance, double start,
                                                        bool stop_defined, double stop)
{
    Instance *m = (Instance *)instance;
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    m->v[TIME] = start;
    m->next_event = start;
    m->phase = INITIALIZING;
    m->fresh = false;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3ExitInitializationMode)(fmi3Instance instance)
{
    Instance *m = (Instance *)instance;
    m->fresh = false;
    refresh(m);
    m->phase = RUNNING;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3EnterEventMode)(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3Terminate)(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3Reset)(fmi3Instance instance)
{
    reset((Instance *)instance);
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3GetFloat64)(fmi3Instance instance, const Reference references[], size_t n, double values[], size_t count)
{
    Instance *m = (Instance *)instance;
    size_t i;
    if (n != count)
        return failed(m, "fmi3GetFloat64: one value for every reference");
    for (i = 0; i < n; i++) {
        if (references[i] >= TOTAL || (references[i] >= HELD && references[i] < SP))
            return failed(m, "fmi3GetFloat64: no such value reference");
        if (references[i] >= DX || m->phase != RUNNING)
            refresh(m);
        values[i] = m->v[references[i]];
    }
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3SetFloat64)(fmi3Instance instance, const Reference references[], size_t n, const double values[],
                                           size_t count)
{
    Instance *m = (Instance *)instance;
    size_t i;
    if (n != count)
        return failed(m, "fmi3SetFloat64: one value for every reference");
    for (i = 0; i < n; i++) {
        const Reference r = references[i];
        const bool start = r >= X && r < X + 12;
        if (!(start || (r >= SP && r < DX)))
            return failed(m, "fmi3SetFloat64: this variable cannot be set");
        if (start && m->phase == RUNNING)
            return failed(m, "fmi3SetFloat64: states are set before or during initialization");
        m->v[r] = values[i];
    }
    m->fresh = false;
    return fmi3OK;
}

/* the state of an instance is its numbers */

FMI3_Export fmi3Status FMI(fmi3GetFMUState)(fmi3Instance instance, void **state)
{
    if (!*state)
        *state = malloc(sizeof(Instance));
    if (!*state)
        return fmi3Error;
    memcpy(*state, instance, sizeof(Instance));
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3SetFMUState)(fmi3Instance instance, void *state)
{
    Instance *m = (Instance *)instance;
    const Instance own = *m;
    memcpy(m, state, sizeof(Instance));
    m->environment = own.environment;
    m->log = own.log;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3FreeFMUState)(fmi3Instance instance, void **state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3SerializedFMUStateSize)(fmi3Instance instance, void *state, size_t *size)
{
    (void)instance, (void)state;
    *size = sizeof(Instance);
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3SerializeFMUState)(fmi3Instance instance, void *state, uint8_t bytes[], size_t size)
{
    if (size < sizeof(Instance))
        return failed((Instance *)instance, "fmi3SerializeFMUState: too little room");
    memcpy(bytes, state, sizeof(Instance));
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3DeserializeFMUState)(fmi3Instance instance, const uint8_t bytes[], size_t size, void **state)
{
    if (size != sizeof(Instance))
        return failed((Instance *)instance, "fmi3DeserializeFMUState: not the state of this model");
    *state = malloc(sizeof(Instance));
    if (!*state)
        return fmi3Error;
    memcpy(*state, bytes, sizeof(Instance));
    return fmi3OK;
}

/* Co-Simulation */

FMI3_Export fmi3Status FMI(fmi3DoStep)(fmi3Instance instance, double now, double dt, bool no_return, bool *events, bool *terminate,
                                       bool *early, double *reached)
{
    Instance *m = (Instance *)instance;
    double ahead[INPUTS];
    int i;
    (void)no_return;
    *events = *terminate = *early = false;
    *reached = now;
    if (!(dt > 0.0))
        return failed(m, "fmi3DoStep: a step must be longer than nothing");
    for (i = 0; i < INPUTS; i++)
        ahead[i] = m->v[U + i] + m->v[SLOPE + i] * dt;
    MODEL_step(m->v + X, m->v + U, ahead, m->v + SP, m->v + SP, m->v + C, dt);
    for (i = 0; i < INPUTS; i++)
        m->v[U + i] = ahead[i];
    m->v[TIME] = now + dt;
    m->fresh = false;
    if (!finite_states(m)) {
        *terminate = true;
        return failed(m, "fmi3DoStep: the model has diverged");
    }
    *reached = now + dt;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3EnterStepMode)(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

/* Model Exchange */

FMI3_Export fmi3Status FMI(fmi3UpdateDiscreteStates)(fmi3Instance instance, bool *again, bool *terminate, bool *nominals, bool *values,
                                                     bool *event_defined, double *event)
{
    Instance *m = (Instance *)instance;
    *again = *terminate = *nominals = *values = false;
    *event_defined = m->exchange && HAS_LAW;
    if (*event_defined && m->v[TIME] >= m->next_event - 1e-9) {
        hold(m);
        m->fresh = false;
        m->next_event = m->v[TIME] + 1.0 / SET_POINT_RATE;
    }
    *event = m->next_event;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3EnterContinuousTimeMode)(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3CompletedIntegratorStep)(fmi3Instance instance, bool no_return, bool *event_mode, bool *terminate)
{
    (void)instance, (void)no_return;
    *event_mode = *terminate = false;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3SetTime)(fmi3Instance instance, double time)
{
    Instance *m = (Instance *)instance;
    m->v[TIME] = time;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3SetContinuousStates)(fmi3Instance instance, const double x[], size_t n)
{
    Instance *m = (Instance *)instance;
    if (n != STATES)
        return failed(m, "fmi3SetContinuousStates: not so many states");
    memcpy(m->v + X, x, sizeof(double) * STATES);
    m->fresh = false;
    return fmi3OK;
}

static fmi3Status given(Instance *m, double to[], size_t n, int from)
{
    if (n != STATES)
        return failed(m, "not so many states");
    refresh(m);
    memcpy(to, m->v + from, sizeof(double) * STATES);
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3GetContinuousStateDerivatives)(fmi3Instance instance, double dx[], size_t n)
{
    return given((Instance *)instance, dx, n, DX);
}

FMI3_Export fmi3Status FMI(fmi3GetContinuousStates)(fmi3Instance instance, double x[], size_t n)
{
    return given((Instance *)instance, x, n, X);
}

FMI3_Export fmi3Status FMI(fmi3GetNominalsOfContinuousStates)(fmi3Instance instance, double nominals[], size_t n)
{
    size_t i;
    (void)instance;
    for (i = 0; i < n; i++)
        nominals[i] = 1.0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3GetEventIndicators)(fmi3Instance instance, double z[], size_t n)
{
    (void)instance, (void)z;
    return n ? fmi3Error : fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3GetNumberOfEventIndicators)(fmi3Instance instance, size_t *n)
{
    (void)instance;
    *n = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3GetNumberOfContinuousStates)(fmi3Instance instance, size_t *n)
{
    (void)instance;
    *n = STATES;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(fmi3EvaluateDiscreteStates)(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

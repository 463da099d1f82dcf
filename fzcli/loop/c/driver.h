/* Runs of one closed loop, LANES at a time. The printed step, initial and finish functions and the
   sizes N_... stand above this. A run of n steps evaluates the step at samples 0..n. */
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct {
    V constants[AT_LEAST_1(N_CONSTANTS)], state[2][AT_LEAST_1(N_STATE)];
    V sums[AT_LEAST_1(N_SAMPLES)], samples[AT_LEAST_1(N_SAMPLES)];
    V stop[1], signals[AT_LEAST_1(N_SIGNALS)];
    V ring[AT_LEAST_1(HISTORY_LENGTH)][AT_LEAST_1(N_SAMPLES)];
    int64_t slot;
} Workspace;

/* One step at sample k: state[k & 1] to the other one, and the history moved on. */
static void advance(Workspace *w, int64_t k)
{
    fzcli_closed_loop_step(w->state[k & 1], w->constants, w->sums, w->state[~k & 1], w->samples, w->stop, w->signals);
#if HISTORY_LENGTH > 0
    V *oldest = w->ring[w->slot];
    for (int j = 0; j < N_SAMPLES; ++j) {
        w->sums[j] = w->sums[j] + (w->samples[j] - oldest[j]);
        oldest[j] = w->samples[j];
    }
    if (++w->slot == HISTORY_LENGTH) w->slot = 0;
#endif
}

/* Arrays with a row for each run; record is (runs, stride, N_SIGNALS) or null. Runs begin in the order given.
   begins: null for fresh runs, else the sample at which each goes on, from its row of states. A run that pauses
   (stop -1) leaves the state before that step in its row of states, and its sample in ends.
   series: null, or a number of the series that each run is of. Once one has ended without a stop, so that it stands in
   passed, those behind it that no lane has taken are left out (stop -2); threads may share passed. */
typedef struct {
    int64_t stride;
    const int64_t *order;
    const double *parameters;
    const int64_t *n_steps, *begins, *series;
    int64_t *passed;
    double *metrics, *record, *states;
    int64_t *ends, *stops;
} Runs;

/* A lane's run, -1 for none; the steps of all lanes at which its first and its last sample are. */
typedef struct { int64_t run, first, last; } Lane;

typedef struct {
    Workspace at;
    V parameters[AT_LEAST_1(N_PARAMETERS)], state[AT_LEAST_1(N_STATE)], constants[AT_LEAST_1(N_CONSTANTS)];
    V end_state[AT_LEAST_1(N_STATE)], end_constants[AT_LEAST_1(N_CONSTANTS)], metrics[AT_LEAST_1(N_METRICS)];
    int64_t next, last;                /* places in the order: of the run to begin next, and behind the last one */
    int64_t begun[LANES], ended[LANES]; /* runs that wait for a lane, or for their metrics */
    int held, taken, waiting;          /* how many were begun, and of them taken; how many wait for metrics */
    Lane lanes[LANES];
} Group;

static int64_t begin_of(const Runs *of, int64_t run) { return of->begins ? of->begins[run] : 0; }

static int left_out(const Runs *of, int64_t run)
{
    if (!of->series || run < __atomic_load_n(&of->passed[of->series[run]], __ATOMIC_RELAXED)) return 0;
    of->stops[run] = -2;
    return 1;
}

/* The next LANES runs begin, aside: the lanes take them one by one. */
static int begin_runs(Group *g, const Runs *of)
{
    g->taken = g->held = 0;
    for (; g->held < LANES && g->next < g->last; ++g->next)
        if (!left_out(of, of->order[g->next])) g->begun[g->held++] = of->order[g->next];
    if (!g->held) return 0;
    FOR_LANES(i) {
        int64_t run = g->begun[i < g->held ? i : g->held - 1]; /* spare ones repeat the last run */
        for (int j = 0; j < N_PARAMETERS; ++j) LANE(g->parameters[j], i) = of->parameters[run * N_PARAMETERS + j];
    }
    fzcli_initial(g->parameters, g->state, g->constants);
    if (of->begins) {
        for (int i = 0; i < g->held; ++i)
            for (int j = 0; j < N_STATE; ++j) LANE(g->state[j], i) = of->states[g->begun[i] * N_STATE + j];
    }
    return 1;
}

/* Lane i takes the next run, if there is one, which begins at step k: as if the lane had never run another. */
static int take_run(Group *g, const Runs *of, int i, int64_t k)
{
    Workspace *w = &g->at;
    int from;
    g->lanes[i].run = -1;
    do {
        if (g->taken == g->held && !begin_runs(g, of)) return 0;
        from = g->taken++;
    } while (left_out(of, g->begun[from]));
    for (int j = 0; j < N_STATE; ++j) LANE(w->state[k & 1][j], i) = LANE(g->state[j], from);
    for (int j = 0; j < N_CONSTANTS; ++j) LANE(w->constants[j], i) = LANE(g->constants[j], from);
    for (int j = 0; j < N_SAMPLES; ++j) {
        LANE(w->sums[j], i) = 0.0;
        for (int old = 0; old < HISTORY_LENGTH; ++old) LANE(w->ring[old][j], i) = 0.0;
    }
    int64_t run = g->begun[from];
    g->lanes[i] = (Lane){run, k, k + of->n_steps[run] - begin_of(of, run)};
    return 1;
}

/* The metrics of the runs that wait for them, LANES at a time. */
static void finish_runs(Group *g, const Runs *of)
{
    fzcli_finish(g->end_state, g->end_constants, g->metrics);
    for (int i = 0; i < g->waiting; ++i)
        for (int j = 0; j < N_METRICS; ++j) of->metrics[g->ended[i] * N_METRICS + j] = LANE(g->metrics[j], i);
    g->waiting = 0;
}

/* The run of lane i ended at step k. */
static void end_run(Group *g, const Runs *of, int i, int64_t k)
{
    const Workspace *w = &g->at;
    int64_t run = g->lanes[i].run;
    of->ends[run] = begin_of(of, run) + k - g->lanes[i].first;
    of->stops[run] = (int64_t)LANE(w->stop[0], i);
    if (of->series && of->stops[run] == 0) __atomic_store_n(&of->passed[of->series[run]], run, __ATOMIC_RELAXED);
    if (of->stops[run] < 0)
        for (int j = 0; j < N_STATE; ++j) of->states[run * N_STATE + j] = LANE(w->state[k & 1][j], i);
    for (int j = 0; j < N_STATE; ++j) LANE(g->end_state[j], g->waiting) = LANE(w->state[~k & 1][j], i);
    for (int j = 0; j < N_CONSTANTS; ++j) LANE(g->end_constants[j], g->waiting) = LANE(w->constants[j], i);
    g->ended[g->waiting] = run;
    if (++g->waiting == LANES) finish_runs(g, of);
}

static void record_sample(const Group *g, const Runs *of, int64_t k)
{
    FOR_LANES(i) if (g->lanes[i].run >= 0) {
        const Lane *lane = &g->lanes[i];
        double *row = of->record + (lane->run * of->stride + begin_of(of, lane->run) + k - lane->first) * N_SIGNALS;
        for (int j = 0; j < N_SIGNALS; ++j) row[j] = LANE(g->at.signals[j], i);
    }
}

/* Runs from place first in the order to the one before last; a lane whose run has ended takes the next. */
static void roll_out(Group *g, const Runs *of, int64_t first, int64_t last)
{
    int running = 0;
    int64_t until = INT64_MAX; /* the step at which the next run ends if none stops before */
    memset(g, 0, sizeof *g);
    g->next = first;
    g->last = last;
    FOR_LANES(i) running += take_run(g, of, i, 0);
    FOR_LANES(i) if (running && g->lanes[i].run < 0) { /* numbers like any, for a spare lane */
        for (int j = 0; j < N_STATE; ++j) LANE(g->at.state[0][j], i) = LANE(g->state[j], 0);
        for (int j = 0; j < N_CONSTANTS; ++j) LANE(g->at.constants[j], i) = LANE(g->constants[j], 0);
    }
    FOR_LANES(i) if (g->lanes[i].run >= 0 && g->lanes[i].last < until) until = g->lanes[i].last;
    for (int64_t k = 0; running > 0; ++k) {
        int stopped = 0;
        advance(&g->at, k);
        if (of->record) record_sample(g, of, k);
        FOR_LANES(i) stopped |= LANE(g->at.stop[0], i) != 0.0;
        if (k < until && !stopped) continue;
        until = INT64_MAX;
        FOR_LANES(i) if (g->lanes[i].run >= 0) {
            if (k == g->lanes[i].last || LANE(g->at.stop[0], i) != 0.0) {
                end_run(g, of, i, k);
                if (!take_run(g, of, i, k + 1)) running -= 1;
            }
            if (g->lanes[i].run >= 0 && g->lanes[i].last < until) until = g->lanes[i].last;
        }
    }
    if (g->waiting) finish_runs(g, of);
}

/* Runs from place first in the order to the one before last. Returns 0, or 1 when there is no memory for the lanes. */
EXPORT int fzcli_rollouts(const Runs *of, int64_t first, int64_t last)
{
    char *block = malloc(sizeof(Group) + 64);
    if (!block) return 1;
    roll_out((Group *)(((uintptr_t)block + 63) & ~(uintptr_t)63), of, first, last);
    free(block);
    return 0;
}

#if LANES == 1
/* A single run advanced from outside, in a workspace of fzcli_workspace_size() bytes, 64-byte aligned:
   one step at sample k; the signals of that sample are copied out, the stop code is returned. */
EXPORT int64_t fzcli_workspace_size(void) { return sizeof(Workspace); }
EXPORT void fzcli_begin(Workspace *w, const double *parameters)
{
    memset(w, 0, sizeof *w);
    fzcli_initial(parameters, w->state[0], w->constants);
}
EXPORT int fzcli_advance(Workspace *w, int64_t k, double *signals)
{
    advance(w, k);
    memcpy(signals, w->signals, N_SIGNALS * sizeof(double));
    return (int)w->stop[0];
}
/* The state before sample k, out to ``state`` or in from it (N_STATE numbers). */
EXPORT void fzcli_state(Workspace *w, int64_t k, double *state, int in)
{
    if (in) memcpy(w->state[k & 1], state, N_STATE * sizeof(double));
    else memcpy(state, w->state[k & 1], N_STATE * sizeof(double));
}
#endif

/* One call of a printed function on arrays of V (64-byte aligned): for single steps and for tests. */
EXPORT void fzcli_call_initial(const V *parameters, V *state, V *constants)
{
    fzcli_initial(parameters, state, constants);
}
EXPORT void fzcli_call_step(const V *state, const V *constants, const V *history, V *next, V *samples, V *stop,
                            V *signals)
{
    fzcli_closed_loop_step(state, constants, history, next, samples, stop, signals);
}
EXPORT void fzcli_call_finish(const V *state, const V *constants, V *metrics)
{
    fzcli_finish(state, constants, metrics);
}

/* Runs of one closed loop, LANES at a time. The printed step, initial and finish functions and the
   sizes N_... stand above this. A run of n steps evaluates the step at samples 0..n. */
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct {
    V parameters[AT_LEAST_1(N_PARAMETERS)], constants[AT_LEAST_1(N_CONSTANTS)];
    V state[2][AT_LEAST_1(N_STATE)];
    V sums[AT_LEAST_1(N_SAMPLES)], samples[AT_LEAST_1(N_SAMPLES)];
    V stop[1], signals[AT_LEAST_1(N_SIGNALS)], metrics[AT_LEAST_1(N_METRICS)];
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

/* begins: null for fresh runs, else the sample at which each goes on, from its row of states. A run that
   pauses (stop -1) leaves the state before that step in its row of states, and its sample in ends. */
static void run_group(Workspace *w, int64_t runs, const double *parameters, const int64_t *n_steps, double *metrics,
                      int64_t *ends, int64_t *stops, double *record, int64_t stride, const int64_t *begins,
                      double *states)
{
    int64_t last = 0, running = runs, begin[LANES];
    int active[LANES];
    memset(w, 0, sizeof *w);
    FOR_LANES(i) {
        int64_t run = i < runs ? i : runs - 1; /* spare lanes repeat the last run */
        active[i] = i < runs;
        begin[i] = begins ? begins[run] : 0;
        for (int j = 0; j < N_PARAMETERS; ++j) LANE(w->parameters[j], i) = parameters[run * N_PARAMETERS + j];
        if (n_steps[run] - begin[i] > last) last = n_steps[run] - begin[i];
    }
    fzcli_initial(w->parameters, w->state[0], w->constants);
    if (begins) {
        FOR_LANES(i) for (int j = 0; j < N_STATE; ++j)
            LANE(w->state[0][j], i) = states[(i < runs ? i : runs - 1) * N_STATE + j];
    }
    for (int64_t k = 0; k <= last && running > 0; ++k) {
        int finished = 0;
        advance(w, k);
        if (record) {
            FOR_LANES(i) if (active[i])
                for (int j = 0; j < N_SIGNALS; ++j)
                    record[(i * stride + begin[i] + k) * N_SIGNALS + j] = LANE(w->signals[j], i);
        }
        FOR_LANES(i) finished |= active[i] && (LANE(w->stop[0], i) != 0.0 || begin[i] + k == n_steps[i]);
        if (finished) {
            fzcli_finish(w->state[~k & 1], w->constants, w->metrics);
            FOR_LANES(i) if (active[i] && (LANE(w->stop[0], i) != 0.0 || begin[i] + k == n_steps[i])) {
                for (int j = 0; j < N_METRICS; ++j) metrics[i * N_METRICS + j] = LANE(w->metrics[j], i);
                ends[i] = begin[i] + k;
                stops[i] = (int64_t)LANE(w->stop[0], i);
                if (stops[i] < 0)
                    for (int j = 0; j < N_STATE; ++j) states[i * N_STATE + j] = LANE(w->state[k & 1][j], i);
                active[i] = 0;
                --running;
            }
        }
    }
}

/* Row-major arrays, one row a run: parameters, metrics, states; record is (runs, stride, N_SIGNALS) or null;
   begins and states as of run_group. Returns 0, or 1 when there is no memory for the workspace. */
EXPORT int fzcli_rollouts(int64_t runs, const double *parameters, const int64_t *n_steps, double *metrics,
                          int64_t *ends, int64_t *stops, double *record, int64_t stride, const int64_t *begins,
                          double *states)
{
    char *block = malloc(sizeof(Workspace) + 64);
    if (!block) return 1;
    Workspace *w = (Workspace *)(((uintptr_t)block + 63) & ~(uintptr_t)63);
    for (int64_t first = 0; first < runs; first += LANES) {
        int64_t group = runs - first < LANES ? runs - first : LANES;
        run_group(w, group, parameters + first * N_PARAMETERS, n_steps + first, metrics + first * N_METRICS,
                  ends + first, stops + first, record ? record + first * stride * N_SIGNALS : 0, stride,
                  begins ? begins + first : 0, states ? states + first * N_STATE : 0);
    }
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

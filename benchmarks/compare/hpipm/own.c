/* Our solver as a contender. The library is opened at run time, so that several builds of it can be timed
 * in one process. */
#include "contender.h"

#include <dlfcn.h>
#include <lpvmpc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

struct library {
    char name[48];
    int (*problem_new)(int, int, int, int, int, lpvmpc_problem **);
    int (*problem_set_all)(lpvmpc_problem *, const double *, size_t);
    int (*problem_set_stage)(lpvmpc_problem *, int, const struct lpvmpc_stage *);
    int (*problem_set_end)(lpvmpc_problem *, const struct lpvmpc_end *);
    void (*problem_free)(lpvmpc_problem *);
    int (*solver_new)(const lpvmpc_problem *, lpvmpc_solver **);
    void (*solver_free)(lpvmpc_solver *);
    int (*solve)(lpvmpc_solver *, const lpvmpc_problem *, int);
    int (*status)(const lpvmpc_solver *, int *);
    int (*inputs)(const lpvmpc_solver *, double *, size_t);
    int (*active)(const lpvmpc_solver *, int *, int *);
    int (*kkt_residual)(const lpvmpc_solver *, const lpvmpc_problem *, double *);
    int (*nothing)(void);
};

struct own {
    const struct library *library;
    const struct sequence *sequence;
    lpvmpc_problem **problems;
    lpvmpc_solver *solver;
    double *inputs;
    int start;
};

static void *symbol(void *handle, const char *name)
{
    void *found = dlsym(handle, name);
    if (!found) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    return found;
}

struct library *library_open(const char *name, const char *path)
{
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!handle) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    struct library *l = calloc(1, sizeof *l);
    snprintf(l->name, sizeof l->name, "%s", name);
    *(void **)&l->problem_new = symbol(handle, "lpvmpc_problem_new");
    *(void **)&l->problem_set_all = symbol(handle, "lpvmpc_problem_set_all");
    *(void **)&l->problem_set_stage = symbol(handle, "lpvmpc_problem_set_stage");
    *(void **)&l->problem_set_end = symbol(handle, "lpvmpc_problem_set_end");
    *(void **)&l->problem_free = symbol(handle, "lpvmpc_problem_free");
    *(void **)&l->solver_new = symbol(handle, "lpvmpc_solver_new");
    *(void **)&l->solver_free = symbol(handle, "lpvmpc_solver_free");
    *(void **)&l->solve = symbol(handle, "lpvmpc_solve");
    *(void **)&l->status = symbol(handle, "lpvmpc_status");
    *(void **)&l->inputs = symbol(handle, "lpvmpc_inputs");
    *(void **)&l->active = symbol(handle, "lpvmpc_active");
    *(void **)&l->kkt_residual = symbol(handle, "lpvmpc_kkt_residual");
    *(void **)&l->nothing = symbol(handle, "lpvmpc_nothing");
    return l;
}

double library_call(const struct library *l)
{
    enum { CALLS = 1000 };
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int call = 0; call < CALLS; call++)
        l->nothing();
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (end.tv_sec - begin.tv_sec + 1e-9 * (end.tv_nsec - begin.tv_nsec)) / CALLS;
}

static void must(int code, const char *what)
{
    if (code != LPVMPC_OK) {
        fprintf(stderr, "lpvmpc: %s: code %d\n", what, code);
        exit(1);
    }
}

static void solve(void *self, int problem)
{
    struct own *o = self;
    o->library->solve(o->solver, o->problems[problem], problem == 0 ? LPVMPC_COLD : o->start);
}

static int first_input(void *self, double *u0)
{
    struct own *o = self;
    int status;
    size_t count = (size_t)o->sequence->horizon * o->sequence->nu;
    must(o->library->status(o->solver, &status), "status");
    must(o->library->inputs(o->solver, o->inputs, count), "inputs");
    for (int j = 0; j < o->sequence->nu; j++)
        u0[j] = o->inputs[j];
    return status;
}

static void own_free(void *self)
{
    struct own *o = self;
    for (int k = 0; k < o->sequence->problems; k++)
        o->library->problem_free(o->problems[k]);
    o->library->solver_free(o->solver);
    free(o->problems);
    free(o->inputs);
    free(o);
}

/* Takes all bounds of a problem away. */
static void unbound(const struct library *l, const struct sequence *s, lpvmpc_problem *problem)
{
    double lower[32], upper[32];
    for (int j = 0; j < 32; j++) {
        lower[j] = -INFINITY;
        upper[j] = INFINITY;
    }
    struct lpvmpc_stage stage = {.x_lower = lower, .x_upper = upper, .u_lower = lower, .u_upper = upper,
                                 .rows_lower = lower, .rows_upper = upper};
    struct lpvmpc_end end = {.x_lower = lower, .x_upper = upper, .rows_lower = lower,
                             .rows_upper = upper};
    for (int i = 0; i < s->horizon; i++)
        must(l->problem_set_stage(problem, i, &stage), "bounds");
    must(l->problem_set_end(problem, &end), "bounds of the end");
}

struct contender *own_new(struct library *l, const struct sequence *s, int warm, int bounded)
{
    struct own *o = calloc(1, sizeof *o);
    o->library = l;
    o->sequence = s;
    o->start = warm ? LPVMPC_SHIFTED : LPVMPC_COLD;
    o->problems = calloc(s->problems, sizeof *o->problems);
    o->inputs = calloc((size_t)s->horizon * s->nu, sizeof(double));
    for (int k = 0; k < s->problems; k++) {
        must(l->problem_new(s->nx, s->nu, s->horizon, s->rows, s->common, &o->problems[k]), "problem");
        must(l->problem_set_all(o->problems[k], sequence_problem(s, k), s->of_problem), "numbers");
        if (!bounded)
            unbound(l, s, o->problems[k]);
    }
    must(l->solver_new(o->problems[0], &o->solver), "solver");
    struct contender *c = calloc(1, sizeof *c);
    snprintf(c->name, sizeof c->name, "%s", l->name);
    snprintf(c->variant, sizeof c->variant, "%s", !bounded ? "no bounds" : warm ? "warm" : "cold");
    c->self = o;
    c->solve = solve;
    c->first_input = first_input;
    c->free = own_free;
    return c;
}

void own_answer(const struct contender *c, int problem, double *residual, int *active)
{
    struct own *o = c->self;
    int changes;
    must(o->library->active(o->solver, active, &changes), "active");
    must(o->library->kkt_residual(o->solver, o->problems[problem], residual), "residual");
}

void contender_free(struct contender *c)
{
    c->free(c->self);
    free(c->shortest);
    free(c->u0);
    free(c);
}
